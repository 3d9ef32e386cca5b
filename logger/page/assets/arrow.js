// Where to walk: the target, an arrow, metres, and the reason; the place once it is found.

import {course, isFound, onScreen, pointOf, radii, wayOf} from './geometry.js';
import {ask} from './marks.js';

const THERE_M = 15; // closer than this the errors of the fixes point the arrow
const byId = id => document.getElementById(id);
const WITHIN_M = 300;
let offered = null;
let withinM = null;

byId('offer').addEventListener('click', () => ask('follow', offered));
byId('auto').addEventListener('click', () => ask('follow', 'suspicious'));
byId('within').addEventListener('click', () => ask('within', withinM === null ? `${WITHIN_M}` : ''));
byId('copy').addEventListener('click', async () => {
  const box = document.createRange();
  box.selectNodeContents(byId('geo'));
  getSelection().removeAllRanges();
  getSelection().addRange(box);
  // a page without TLS has no clipboard interface
  byId('copy').textContent = document.execCommand('copy') ? 'Copied' : 'Selected';
});

function set(id, text) {
  if (byId(id).textContent !== text) byId(id).textContent = text;
}

const wordOf = (status, cell) => status?.suspicions.find(one => one.cell === cell)?.word ?? '';

/** The cell that is searched for, with its word, and how the search ended. */
export function targetText(status) {
  const target = status?.target;
  if (!target) return 'No cell yet.';
  const word = wordOf(status, target.cell);
  const what = `${word ? `${word} cell ` : ''}${target.cell}`;
  if (isFound(status)) {
    return `Found: ${[what, radii(status.position), target.supposition].filter(Boolean).join(', ')}.`;
  }
  if (target.over && target.over !== 'located') return `Given up: ${what}; ${target.over}.`;
  const why = word === 'suspicious' ? '' : status.followed === target.cell ? ', as you chose' : ', the strongest cell when it was chosen';
  return `To ${word ? `the ${what}` : `cell ${what}`}${why}.`;
}

function showChoice(status) {
  withinM = status?.within_walk_m ?? null;
  byId('within').setAttribute('aria-pressed', withinM !== null);
  set('within', `Within ${withinM ?? WITHIN_M} m of where I walk`);
  offered = status?.offer ?? null;
  byId('offer').hidden = !offered;
  if (offered) set('offer', `Search for ${[wordOf(status, offered), offered].filter(Boolean).join(' ')}`);
  byId('auto').hidden = !status?.followed;
  byId('choice').hidden = !offered && !status?.followed;
  const position = isFound(status) ? status.position : null;
  byId('found').hidden = !position;
  if (!position) return;
  const place = `${position.lat.toFixed(5)}, ${position.lon.toFixed(5)}`;
  if (byId('geo').textContent !== place) set('copy', 'Copy');
  set('geo', place);
  byId('geo').href = `geo:${position.lat.toFixed(5)},${position.lon.toFixed(5)};u=${Math.round(position.r95_m)}`;
}

/** Why nothing points anywhere, in accord with what the glance says to do. */
function noWay(status) {
  if (status?.state === 'error') return 'No advice meanwhile.';
  if (status?.state === 'no fix') return 'No advice without a position.';
  return status?.target?.over ? 'Nothing leads on.' : 'No advice yet: walk on.';
}

export function showArrow({status, isOld}) {
  // an arrow that is no longer renewed leads astray
  const way = isOld ? null : wayOf(status);
  const isThere = way !== null && isFound(status) && way.metres < THERE_M;
  const courseDeg = course(status?.fix, status?.now_ns);
  const north = onScreen(0, courseDeg) * Math.PI / 180;
  set('target', targetText(status));
  showChoice(isOld ? {...status, offer: null, followed: null} : status);
  byId('north').setAttribute('x', 82 * Math.sin(north));
  byId('north').setAttribute('y', -82 * Math.cos(north));
  byId('needle').toggleAttribute('hidden', !way || isThere);
  set('why', way && !isFound(status) && status.next.why ? `Why: ${status.next.why}.` : '');
  if (!way || isThere) {
    set('metres', isThere ? 'here' : '–');
    set('frame', isThere ? 'Look around.' : isOld ? 'No advice without news.' : noWay(status));
    byId('arrow').setAttribute('aria-label', isThere ? 'you are there' : 'no advice');
    return;
  }
  const angle = onScreen(way.azimuthDeg, courseDeg);
  byId('needle').setAttribute('transform', `rotate(${angle.toFixed(0)})`);
  set('metres', `${Math.round(way.metres)} m`);
  set('frame', courseDeg === null
    ? `${pointOf(way.azimuthDeg)}; you stand: up is north`
    : `${pointOf(way.azimuthDeg)}; up is the way you walk`);
  byId('arrow').setAttribute('aria-label', `${way.metres.toFixed(0)} m ${pointOf(way.azimuthDeg)}`);
}
