// The plan: track coloured by level, heading, region and places, over a plain grid.

import {METRES_PER_DEG, course, lonNear, metres, roundStep} from './geometry.js';
import {prepared, stopOf} from './drawing.js';
import {showGround} from './map.js';

const NEAR_M = 120;
const BEYOND_M = 400;
const FETCH_MS = 1000;
const byId = id => document.getElementById(id);
let track = {run: '', cell: '', points: [], levels: [], marks: []};
let fetchedMs = -Infinity;

byId('near').addEventListener('click', () => {
  const pressed = byId('near').getAttribute('aria-pressed') !== 'true';
  byId('near').setAttribute('aria-pressed', String(pressed));
});

async function fetchTrack() {
  if (performance.now() - fetchedMs < FETCH_MS) return;
  fetchedMs = performance.now();
  const reply = await fetch(`track?point=${track.points.length}&level=${track.levels.length}`).catch(() => null);
  if (!reply?.ok) return;
  const news = await reply.json();
  if (news.run !== track.run || news.cell !== track.cell) {
    // what was asked for began in the middle of another run or cell
    const isFresh = track.points.length + track.levels.length === 0;
    track = isFresh ? news : {run: news.run, cell: news.cell, points: [], levels: [], marks: []};
    if (!isFresh) fetchedMs = -Infinity;
    return;
  }
  track.points.push(...news.points);
  track.levels.push(...news.levels);
  track.marks = news.marks;
}

const ringsOf = region => region ? region.coordinates.flat() : [];

/** Places that must be visible. */
function places(status, isNear) {
  const fix = status?.fix?.valid ? [[status.fix.lat_deg, status.fix.lon_deg]] : [];
  const position = status?.position;
  if (isNear && fix.length) return fix;
  const next = status?.next?.lat != null ? [[status.next.lat, status.next.lon]] : [];
  const modes = (position?.modes ?? []).map(mode => [mode.lat, mode.lon]);
  const region = ringsOf(position?.region).flat().map(([lon, lat]) => [lat, lon]);
  const walked = beside([...fix, ...track.points, ...next]);
  return [...walked, ...near(beside([...walked, ...modes, ...region]).slice(walked.length), walked)];
}

/** Places with longitudes that do not jump from the first. */
const beside = places => places.map(([lat, lon]) => [lat, lonNear(lon, places[0][1])]);

/** Places moved to within `BEYOND_M` of the walk: of a larger region the walk would be a dot. */
function near(places, walked) {
  if (!walked.length) return places;
  const [lats, lons] = [0, 1].map(k => walked.map(place => place[k]));
  const marginN = BEYOND_M / METRES_PER_DEG, marginE = marginN / Math.cos(lats[0] * Math.PI / 180);
  const within = (value, values, margin) => {
    const [low, high] = span(values);
    return Math.max(low - margin, Math.min(high + margin, value));
  };
  return places.map(([lat, lon]) => [within(lat, lats, marginN), within(lon, lons, marginE)]);
}

const span = values => values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);

/** Projection that shows all places in a box, in metres of the same length in both directions. */
function projection(all, width, height, leastM) {
  const lats = all.map(place => place[0]), lons = all.map(place => place[1]);
  const [[south, north], [west, east]] = [span(lats), span(lons)];
  const centre = {lat: (south + north) / 2, lon: (west + east) / 2};
  const [halfE, halfN] = metres(centre, north, east);
  const perPixel = Math.max(2.3 * halfE / width, 2.3 * halfN / height, leastM / Math.min(width, height));
  const at = (lat, lon) => {
    const [e, n] = metres(centre, lat, lon);
    return [width / 2 + e / perPixel, height / 2 - n / perPixel];
  };
  return {at, perPixel, centre};
}

export function showPlan({status, has_map: hasMap}) {
  fetchTrack();
  const {g, width, height, colour} = prepared(byId('plan'));
  if (!width || !height) return;
  const isNear = byId('near').getAttribute('aria-pressed') === 'true';
  const all = places(status, isNear);
  const {at, perPixel, centre} = projection(all.length ? all : [[0, 0]], width, height, NEAR_M);
  const hasGround = showGround(hasMap && all.length > 0, centre, perPixel, colour);
  if (!hasGround) drawGrid(g, width, height, perPixel, colour);
  drawScale(g, width, height, perPixel, colour);
  if (!all.length) return;
  drawRegion(g, at, status?.position, colour);
  drawTrack(g, at, status?.fix, colour);
  drawPlaces(g, at, status, colour);
  drawWalker(g, at, status, colour);
  describe(status?.position);
}

function drawGrid(g, width, height, perPixel, colour) {
  const pixels = roundStep(60 * perPixel) / perPixel;
  g.strokeStyle = colour('line');
  g.lineWidth = 0.5;
  for (let x = (width / 2) % pixels; x < width; x += pixels) line(g, x, 0, x, height);
  for (let y = (height / 2) % pixels; y < height; y += pixels) line(g, 0, y, width, y);
}

function drawScale(g, width, height, perPixel, colour) {
  const step = roundStep(60 * perPixel), pixels = step / perPixel;
  g.strokeStyle = g.fillStyle = colour('ink');
  g.lineWidth = 3;
  line(g, 10, height - 12, 10 + pixels, height - 12);
  g.font = '13px system-ui';
  g.fillText(step >= 1000 ? `${step / 1000} km` : `${step} m`, 10, height - 18);
  g.lineWidth = 2;
  line(g, width - 18, 34, width - 18, 12);
  line(g, width - 23, 18, width - 18, 12);
  line(g, width - 13, 18, width - 18, 12);
  g.fillText('N', width - 23, 48);
}

function line(g, x0, y0, x1, y1) {
  g.beginPath(); g.moveTo(x0, y0); g.lineTo(x1, y1); g.stroke();
}

function drawRegion(g, at, position, colour) {
  g.fillStyle = colour('cell');
  g.beginPath();
  for (const ring of ringsOf(position?.region)) {
    ring.forEach(([lon, lat], i) => g[i ? 'lineTo' : 'moveTo'](...at(lat, lon)));
    g.closePath();
  }
  g.globalAlpha = 0.3; g.fill('evenodd'); g.globalAlpha = 1;
}

function drawTrack(g, at, fix, colour) {
  g.strokeStyle = colour('soft');
  g.lineWidth = 1;
  g.beginPath();
  for (const [lat, lon] of track.points) g.lineTo(...at(lat, lon));
  if (fix?.valid) g.lineTo(...at(fix.lat_deg, fix.lon_deg));
  g.stroke();
  for (const [i, level] of track.levels) {
    const point = track.points[i];
    if (!point) continue;
    const [x, y] = at(...point);
    g.fillStyle = colour(stopOf(level));
    g.beginPath(); g.arc(x, y, 3.5, 0, 7); g.fill();
  }
}

function drawPlaces(g, at, status, colour) {
  g.fillStyle = g.strokeStyle = colour('ink');
  g.font = '13px system-ui';
  g.lineWidth = 2;
  const modes = status?.position?.modes ?? [];
  modes.forEach((mode, i) => {
    const [x, y] = at(mode.lat, mode.lon);
    line(g, x - 7, y - 7, x + 7, y + 7);
    line(g, x - 7, y + 7, x + 7, y - 7);
    // numbers, the likeliest first: a share of the places says nothing of how large the region is
    if (modes.length > 1) g.fillText(`${i + 1}`, x + 9, y + 4);
  });
  for (const [lat, lon] of track.marks) {
    const [x, y] = at(lat, lon);
    line(g, x, y, x, y - 14);
    g.fillRect(x, y - 14, 9, 6);
  }
  const next = status?.next, fix = status?.fix;
  if (next?.lat == null || !fix?.valid) return;
  g.setLineDash([6, 5]);
  line(g, ...at(fix.lat_deg, fix.lon_deg), ...at(next.lat, next.lon));
  g.setLineDash([]);
}

function drawWalker(g, at, status, colour) {
  const fix = status?.fix;
  if (!fix?.valid) return;
  const [x, y] = at(fix.lat_deg, fix.lon_deg);
  const courseDeg = course(fix, status.now_ns);
  g.save();
  g.translate(x, y);
  g.fillStyle = colour('ink');
  g.strokeStyle = colour('paper');
  g.beginPath();
  if (courseDeg === null) g.arc(0, 0, 7, 0, 7);
  else {
    g.rotate(courseDeg * Math.PI / 180);
    g.moveTo(0, -12); g.lineTo(8, 9); g.lineTo(0, 5); g.lineTo(-8, 9); g.closePath();
  }
  g.fill(); g.stroke();
  g.restore();
}

function describe(position) {
  const text = position ? `${position.cell}: ${position.text}` : '';
  byId('place').textContent = text;
  byId('plan').setAttribute('aria-label', `plan of the walk, north is up. ${text}`);
}
