// One cell: level, average, peak, the last minute, warmer or colder, and its sound.

import {soundLevel} from './sound.js';
import {prepared} from './drawing.js';

const STEADY_DB = 1.5;
const OLD_S = 10;
const SPAN_DBM = [-113, -45];
const byId = id => document.getElementById(id);
const dbm = value => value == null ? '–' : `${Math.round(value)}`;

export function showFinder(state) {
  const {status, cell} = state;
  const row = status?.cells.find(one => one.cell === cell);
  const ageS = row ? (status.now_ns - row.heard_ns) / 1e9 : 0;
  const isOld = state.isOld || ageS > OLD_S;
  byId('cell').textContent = !cell ? 'no cell yet' : `${cell}${ageS > OLD_S ? `, not heard for ${Math.round(ageS)} s` : ''}`;
  byId('level').textContent = row && !isOld ? dbm(row.level_dbm) : '–';
  byId('average').textContent = isOld ? '–' : dbm(row?.average_dbm);
  byId('peak').textContent = dbm(row?.peak_dbm);
  byId('trend').textContent = isOld ? '' : word(row?.trend_db);
  drawMinute(state.minute);
  soundLevel(isOld ? null : row?.level_dbm ?? null);
}

function word(trendDb) {
  if (trendDb == null) return '';
  if (Math.abs(trendDb) < STEADY_DB) return '= steady';
  return trendDb > 0 ? `▲ warmer, ${trendDb.toFixed(0)} dB` : `▼ colder, ${(-trendDb).toFixed(0)} dB`;
}

function drawMinute(minute) {
  const canvas = byId('minute');
  const {g, width, height, colour} = prepared(canvas);
  const y = level => height * (SPAN_DBM[1] - level) / (SPAN_DBM[1] - SPAN_DBM[0]);
  g.strokeStyle = colour('line');
  g.fillStyle = colour('soft');
  g.font = '11px system-ui';
  for (const level of [-100, -80, -60]) {
    g.beginPath(); g.moveTo(0, y(level)); g.lineTo(width, y(level)); g.stroke();
    g.fillText(`${level}`, 2, y(level) - 2);
  }
  g.fillStyle = g.strokeStyle = colour('ink');
  g.lineWidth = 2;
  g.beginPath();
  for (const [age, level] of minute) g.lineTo(width * (1 - age / 60), y(level));
  g.stroke();
  for (const [age, level] of minute) g.fillRect(width * (1 - age / 60) - 2, y(level) - 2, 4, 4);
  const text = minute.length ? `${minute.length} readings, latest ${dbm(minute.at(-1)[1])} dBm` : 'no reading';
  canvas.setAttribute('aria-label', `level of the last minute: ${text}`);
}
