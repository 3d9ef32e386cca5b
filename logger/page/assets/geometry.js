// Directions and distances, without the page.

export const METRES_PER_DEG = 111320;
const MOVING_MPS = 0.5;
const FRESH_NS = 5e9;
const POINTS = ['north', 'north-east', 'east', 'south-east', 'south', 'south-west', 'west', 'north-west'];

/** Course of the walker in degrees, null while standing: GPS knows a direction only of motion. */
export function course(fix, nowNs) {
  const moves = fix && fix.valid && fix.course_deg != null && fix.speed_mps >= MOVING_MPS;
  return moves && nowNs - fix.t_ns < FRESH_NS ? fix.course_deg : null;
}

/** Angle of an azimuth on the screen, where up is the course, or north without one. */
export function onScreen(azimuthDeg, courseDeg) {
  return (((azimuthDeg - (courseDeg ?? 0)) % 360) + 360) % 360;
}

export const pointOf = azimuthDeg => POINTS[Math.round(azimuthDeg / 45) % 8];

/** Metres east and north of a place. */
export function metres(from, lat, lon) {
  const east = METRES_PER_DEG * Math.cos(from.lat * Math.PI / 180);
  return [(lon - from.lon) * east, (lat - from.lat) * METRES_PER_DEG];
}

/** The next of 1, 2, 5, 10, ... that is at least this many metres. */
export function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(n => n * power).find(step => step >= least);
}
