// What the walker tells the recorder: a mark, or a cell to follow.

import {isPlaced} from './geometry.js';

const answer = document.getElementById('answer');
let nMarks = 0;
let hasPlace = true;
let showFrom = Infinity;

/** Ask the Pi for something; true once it is on the card. */
export async function ask(what, text) {
  let why = 'no contact with the Pi';
  try {
    const reply = await fetch(what, {
      method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(text),
    });
    if (reply.ok) return true;
    why = (await reply.text()).replace(/^\d+ /, '').trim() || why;
  } catch {
    // the Pi is out of reach
  }
  answer.textContent = `Not done: ${why}.`;
  return false;
}

document.getElementById('mark').addEventListener('submit', async event => {
  event.preventDefault();
  const note = document.getElementById('note');
  const [text, before] = [note.value, nMarks];
  answer.textContent = 'Sent; not on the card yet.';
  if (!await ask('mark', text || 'here!')) return;
  if (note.value === text) note.value = '';
  showFrom = before + 1;
  answerFor(nMarks);
});

/** The news have the number of a mark, before or after the answer. */
export function takeAnswer({n_marks: n, status}) {
  nMarks = n;
  hasPlace = !status || isPlaced(status);
  answerFor(n);
}

function answerFor(n) {
  if (n < showFrom) return;
  showFrom = Infinity;
  answer.textContent = `Mark ${n} is on the card${hasPlace ? '' : ', without a position: there is none now'}.`;
}
