// Where to walk: an arrow, metres, and the reason.

import {course, onScreen, pointOf, wayOf} from './geometry.js';

const byId = id => document.getElementById(id);

export function showArrow({status, isOld}) {
  // an arrow that is no longer renewed leads astray
  const way = isOld ? null : wayOf(status);
  const courseDeg = course(status?.fix, status?.now_ns);
  const north = onScreen(0, courseDeg) * Math.PI / 180;
  byId('north').setAttribute('x', 82 * Math.sin(north));
  byId('north').setAttribute('y', -82 * Math.cos(north));
  byId('needle').toggleAttribute('hidden', !way);
  byId('why').textContent = way ? status.next.text : '';
  if (!way) {
    byId('metres').textContent = '–';
    byId('frame').textContent = isOld ? 'No advice without news.' : 'No advice: walk on.';
    byId('arrow').setAttribute('aria-label', 'no advice');
    return;
  }
  const angle = onScreen(way.azimuthDeg, courseDeg);
  byId('needle').setAttribute('transform', `rotate(${angle.toFixed(0)})`);
  byId('metres').textContent = `${Math.round(way.metres)} m`;
  byId('frame').textContent = courseDeg === null
    ? `${pointOf(way.azimuthDeg)}; you stand: up is north`
    : `${pointOf(way.azimuthDeg)}; up is the way you walk`;
  byId('arrow').setAttribute('aria-label', `${way.metres.toFixed(0)} m ${pointOf(way.azimuthDeg)}`);
}
