// The cells, in the order of the status; a tap follows one.

import {ask} from './marks.js';

const list = document.getElementById('cells');
const search = document.getElementById('search');
const rows = new Map();

function made(tag, name) {
  const element = document.createElement(tag);
  element.className = name;
  return element;
}

function newRow(cell) {
  const li = document.createElement('li');
  const row = {li, name: made('span', 'name'), facts: made('p', 'facts'), words: made('div', 'words'),
    button: made('button', 'follow')};
  row.name.textContent = cell;
  row.button.addEventListener('click', () => ask('follow', cell));
  li.append(row.name, row.facts, row.words, row.button);
  return row;
}

function facts(cell, nowNs) {
  const ageS = Math.round((nowNs - cell.heard_ns) / 1e9);
  return [cell.rat, cell.channel == null ? '' : `channel ${cell.channel}`,
    cell.level_dbm == null ? '' : `${Math.round(cell.level_dbm)} dBm`,
    cell.ta_m == null ? '' : `TA ${Math.round(cell.ta_m)} m`, cell.verdict === 'cannot tell' ? '' : cell.verdict ?? '',
    ageS > 5 ? `${ageS} s ago` : ''].filter(Boolean).join(' · ');
}

function fill(row, cell, status) {
  row.name.classList.toggle('serving', cell.is_serving);
  row.facts.textContent = facts(cell, status.now_ns);
  const words = JSON.stringify([cell.word, cell.reasons]);
  if (row.shown !== words) {
    row.shown = words;
    row.words.replaceChildren(...reasons(cell));
  }
  const isFollowed = status.followed === cell.cell;
  row.button.textContent = isFollowed ? 'Following' : 'Follow';
  row.button.setAttribute('aria-label', `${row.button.textContent} ${cell.cell}`);
  row.button.setAttribute('aria-pressed', String(isFollowed));
}

function reasons(cell) {
  if (!cell.word) return [];
  const word = document.createElement('strong');
  word.textContent = cell.word;
  const why = document.createElement('ul');
  why.append(...cell.reasons.map(text => Object.assign(document.createElement('li'), {textContent: text})));
  return [word, why];
}

export function showCells({status}) {
  const cells = status?.cells ?? [];
  const wanted = search.value.trim().toLowerCase();
  const shown = cells.filter(cell => `${cell.cell} ${cell.word ?? ''}`.toLowerCase().includes(wanted));
  const known = new Set(cells.map(cell => cell.cell));
  for (const name of rows.keys()) if (!known.has(name)) { rows.get(name).li.remove(); rows.delete(name); }
  for (const cell of cells) {
    if (!rows.has(cell.cell)) rows.set(cell.cell, newRow(cell.cell));
    fill(rows.get(cell.cell), cell, status);
  }
  document.getElementById('unnoticed').textContent = status?.unnoticed ?? '';
  const wantedRows = shown.map(cell => rows.get(cell.cell).li);
  // moved only where the order is another: a moved button loses its tap
  if (wantedRows.length !== list.children.length || wantedRows.some((li, i) => li !== list.children[i])) {
    list.replaceChildren(...wantedRows);
  }
}
