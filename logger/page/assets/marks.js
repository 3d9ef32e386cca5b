// What the walker tells the recorder: a mark, or a cell to follow.

const answer = document.getElementById('answer');
const WHY = {429: 'too many at once', 507: 'the Pi has no room'};
let nMarks = null;
let waiting = false;

/** Ask the Pi for something; true if it will be done. */
export async function ask(what, text) {
  let reply;
  try {
    reply = await fetch(what, {
      method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(text),
    });
  } catch {
    reply = {ok: false, status: 0};
  }
  if (!reply.ok) answer.textContent = `Not done: ${WHY[reply.status] ?? 'no contact with the Pi'}.`;
  return reply.ok;
}

document.getElementById('mark').addEventListener('submit', async event => {
  event.preventDefault();
  const note = document.getElementById('note');
  waiting = await ask('mark', note.value || 'here!');
  if (!waiting) return;
  note.value = '';
  answer.textContent = 'Sent; not on the card yet.';
});

/** A mark counts once it is on the card. */
export function takeAnswer({n_marks: n}) {
  if (waiting && nMarks !== null && n > nMarks) {
    waiting = false;
    answer.textContent = `Mark ${n} is on the card.`;
  }
  nMarks = n;
}
