// Directions and distances, without the page.

export const METRES_PER_DEG = 111320;
const MOVING_MPS = 0.5;
const FRESH_NS = 5e9;
const NEAR_M = 30;
const POINTS = ['north', 'north-east', 'east', 'south-east', 'south', 'south-west', 'west', 'north-west'];

/** Whether the receiver has said this of late. */
export const isFresh = (fix, nowNs) => fix != null && nowNs - fix.t_ns < FRESH_NS;

/** Course of the walker in degrees, null while standing: GPS knows a direction only of motion. */
export function course(fix, nowNs) {
  const moves = fix?.valid && fix.course_deg != null && fix.speed_mps >= MOVING_MPS;
  return moves && isFresh(fix, nowNs) ? fix.course_deg : null;
}

/** Whether it is known where the walker is: a way from where they were leads astray. */
export function isPlaced(status) {
  if (status.state === 'error') return Boolean(status.fix?.valid) && isFresh(status.fix, status.now_ns);
  return status.state !== 'no fix';
}

/** Angle of an azimuth on the screen, where up is the course, or north without one. */
export function onScreen(azimuthDeg, courseDeg) {
  return (((azimuthDeg - (courseDeg ?? 0)) % 360) + 360) % 360;
}

export const pointOf = azimuthDeg => POINTS[Math.round(azimuthDeg / 45) % 8];

/** A longitude within half a turn of another one: a walk may cross 180 degrees. */
export const lonNear = (lon, other) => lon + 360 * Math.round((other - lon) / 360);

/** Metres east and north of a place. */
export function metres(from, lat, lon) {
  const east = METRES_PER_DEG * Math.cos(from.lat * Math.PI / 180);
  return [(lonNear(lon, from.lon) - from.lon) * east, (lat - from.lat) * METRES_PER_DEG];
}

/** Whether the target is located: the arrow then points at its place. */
export const isFound = status => status?.position?.verdict === 'located';

/**
 * Way from where the walker is now to the place that was found, else to the end of the advice: a new one
 * comes only after 25 m. Close to its end the direction is that of the advice, since the errors of the fix
 * would turn the arrow about.
 */
export function wayOf(status) {
  const next = isFound(status) ? status.position : status?.next, fix = status?.fix;
  if (!next || !isPlaced(status)) return null;
  if (!fix?.valid) return next.azimuth_deg == null ? null : {azimuthDeg: next.azimuth_deg, metres: next.distance_m};
  const [east, north] = metres({lat: fix.lat_deg, lon: fix.lon_deg}, next.lat, next.lon);
  const left = Math.hypot(east, north);
  const isNear = left < NEAR_M && next.azimuth_deg != null;
  const azimuthDeg = isNear ? next.azimuth_deg : (Math.atan2(east, north) * 180 / Math.PI + 360) % 360;
  return {azimuthDeg, metres: left};
}

/** The next of 1, 2, 5, 10, ... that is at least this many metres. */
export function roundStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map(n => n * power).find(step => step >= least);
}

const lengthText = m => m < 1000 ? `${Math.round(m)}\u00a0m` : `${(m / 1000).toFixed(1)}\u00a0km`;

/** How far from the position the transmitter is: half of the probability, and 95 %. */
export function radii({r50_m: r50, r95_m: r95}) {
  return `most likely within ${lengthText(r50)}, surely within ${lengthText(r95)}`;
}
