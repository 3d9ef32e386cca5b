// State of the recording at one glance: colour, pattern, sign, sentence.

import {isFound, wayOf} from './geometry.js';

const SIGNS = {recording: '●', suspicious: '◆', 'no-fix': '▲', trouble: '✕', stopped: '■'};
const byId = id => document.getElementById(id);

/** Sign, sentence and what to do now. */
export function glance(state, silentMs) {
  if (silentMs) {
    return ['trouble', `No contact with the Pi for ${Math.round(silentMs / 1000)} s`,
      'It may still be recording: look at its light, or go closer to it.'];
  }
  const status = state?.status;
  if (!status) return ['trouble', 'Nothing is being recorded', 'The service is not running.'];
  if (state.kept != null) {
    const kept = String(state.kept).replace(/\B(?=(\d{3})+$)/g, '\u00a0');
    return ['stopped', `Stopped in order, ${kept} readings kept`, 'The run will be among the closed runs below.'];
  }
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
  // the text names what is worst: a card that takes nothing hides the ports
  const said = ([name, port]) => port.fault && status.text.includes(`${name}: ${port.fault}`);
  const faulty = ports.filter(said).map(([name]) => name);
  if (ports.length < 3 || !faulty.length || faulty.length === ports.length) {
    return 'Trouble: this walk is not being recorded';
  }
  return `Trouble with ${faulty.join(' and ')}; the others are being recorded`;
}

function place(status) {
  if (isFound(status)) return '; located';
  const modes = status.position?.modes ?? [];
  return modes.length > 1 ? `; ${modes.length} places fit` : '';
}

/** The one thing to do now; where and how far is said by the arrow. */
function advice(status) {
  if (isFound(status)) return 'Go and look, as the arrow shows; what to do stands below it.';
  if (wayOf(status)) return 'Walk as the arrow shows.';
  if (status.target?.over) return status.offer ? 'Walk where you like, or choose the next cell below.' : 'Walk where you like.';
  return 'Walk on; change direction at the next crossing.';
}

export function showGlance(state, silentMs) {
  const [sign, sentence, todo] = glance(state, silentMs);
  byId('glance').dataset.sign = sign;
  // a screen reader says that contact is lost, not each second of it
  const words = (...texts) => texts.join(' ').replace(/\d+/g, '');
  const before = words(byId('state').textContent, byId('todo').textContent);
  byId('glance').ariaLive = before === words(sentence, todo) ? 'off' : 'polite';
  for (const [id, text] of [['sign', SIGNS[sign]], ['state', sentence], ['todo', todo]]) {
    if (byId(id).textContent !== text) byId(id).textContent = text;
  }
}
