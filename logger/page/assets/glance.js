// State of the recording at one glance: colour, pattern, sign, sentence.

import {radii, wayOf} from './geometry.js';

const SIGNS = {recording: '●', suspicious: '◆', 'no-fix': '▲', trouble: '✕'};
const byId = id => document.getElementById(id);

/** Sign, sentence and what to do now. */
export function glance(state, silentMs) {
  if (silentMs) {
    return ['trouble', `No contact with the Pi for ${Math.round(silentMs / 1000)} s`,
      'It may still be recording: look at its light, or go closer to it.'];
  }
  const status = state?.status;
  if (!status) return ['trouble', 'Nothing is being recorded', 'The service is not running.'];
  if (state.silent_s) {
    return ['trouble', `The recorder is silent for ${Math.round(state.silent_s)} s`,
      'It starts again by itself; if not, restart the Pi.'];
  }
  if (status.state === 'error') return ['trouble', trouble(status), status.text];
  if (status.state === 'no fix') {
    return ['no-fix', 'Recording, but there is no position', 'Stand under the open sky for a minute.'];
  }
  if (status.no_estimate) {
    return ['recording', 'Recording, but without a live estimate', 'Walk on: the desktop program computes it.'];
  }
  if (status.state === 'suspicious') return ['suspicious', `Recording; a cell is suspicious${place(status)}`, advice(status)];
  return ['recording', `Recording${place(status)}`, advice(status)];
}

function trouble(status) {
  const ports = Object.entries(status.ports ?? {});
  const faulty = ports.filter(([, port]) => port.fault).map(([name]) => name);
  if (ports.length < 3 || !faulty.length || faulty.length === ports.length) {
    return 'Trouble: this walk is not being recorded';
  }
  return `Trouble with ${faulty.join(' and ')}; the others are being recorded`;
}

const isLocated = status => status.position?.verdict === 'located';

const LEAST_PLACE = 0.1; // less likely places are not counted

function place(status) {
  if (isLocated(status)) return `; located, ${radii(status.position)}`;
  const likely = (status.position?.modes ?? []).filter(mode => mode.probability >= LEAST_PLACE);
  return likely.length > 1 ? `; ${likely.length} places fit` : '';
}

// in steps, since a screen reader says each change of this sentence
const tens = metres => Math.max(10, 10 * Math.round(metres / 10));

function advice(status) {
  const way = wayOf(status);
  if (way && isLocated(status)) return `You may end here, or walk ${tens(way.metres)} m as the arrow shows.`;
  if (way) return `Walk ${tens(way.metres)} m as the arrow shows.`;
  if (isLocated(status)) return 'You may end here.';
  return 'Walk on; change direction at the next crossing.';
}

export function showGlance(state, silentMs) {
  const [sign, sentence, todo] = glance(state, silentMs);
  byId('glance').dataset.sign = sign;
  for (const [id, text] of [['sign', SIGNS[sign]], ['state', sentence], ['todo', todo]]) {
    if (byId(id).textContent !== text) byId(id).textContent = text;
  }
}
