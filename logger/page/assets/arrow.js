// Where to walk: an arrow, metres, and the reason.

import {course, onScreen, pointOf} from './geometry.js';

const byId = id => document.getElementById(id);

export function showArrow({status}) {
  const next = status?.next;
  const courseDeg = course(status?.fix, status?.now_ns);
  const north = onScreen(0, courseDeg) * Math.PI / 180;
  byId('north').setAttribute('x', 82 * Math.sin(north));
  byId('north').setAttribute('y', -82 * Math.cos(north));
  byId('needle').toggleAttribute('hidden', !next);
  byId('why').textContent = next?.text ?? '';
  if (!next) {
    byId('metres').textContent = '–';
    byId('frame').textContent = 'No advice: walk on.';
    byId('arrow').setAttribute('aria-label', 'no advice');
    return;
  }
  const angle = onScreen(next.azimuth_deg, courseDeg);
  byId('needle').setAttribute('transform', `rotate(${angle.toFixed(0)})`);
  byId('metres').textContent = `${Math.round(next.distance_m)} m`;
  byId('frame').textContent = courseDeg === null
    ? `${pointOf(next.azimuth_deg)}; you stand: up is north`
    : `${pointOf(next.azimuth_deg)}; up is the way you walk`;
  byId('arrow').setAttribute('aria-label', `${next.distance_m.toFixed(0)} m ${pointOf(next.azimuth_deg)}`);
}
