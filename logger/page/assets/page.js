// The page: takes news from the Pi and gives them to its parts.

import {showArrow} from './arrow.js';
import {showCells} from './cells.js';
import {showCounters, showRuns} from './counters.js';
import {showFinder} from './finder.js';
import {showGlance} from './glance.js';
import {takeAnswer} from './marks.js';
import {showPlan} from './plan.js';
import './awake.js';
import './theme.js';

const SILENT_MS = 3000;
const AGAIN_MS = 3000;
// a connection that lived through a gap of the Wi-Fi may stay silent for minutes
const LOST_MS = 10000;

let latest = null;
let heardMs = performance.now();
let triedMs = heardMs;
let source = null;

function connect() {
  source?.close();
  source = new EventSource('live');
  triedMs = performance.now();
  source.onmessage = event => {
    heardMs = performance.now();
    latest = JSON.parse(event.data);
    show();
  };
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN_MS);
  };
}

const news = isSilent => ({...latest, isOld: isSilent || latest.silent_s > 0});

/** Canvases keep the colours in which they were drawn. */
function redraw() {
  if (latest === null) return;
  const state = news(performance.now() - heardMs > SILENT_MS);
  for (const part of [showFinder, showPlan]) part(state);
}

function show() {
  const silentMs = performance.now() - heardMs;
  const isSilent = silentMs > SILENT_MS;
  showGlance(latest, isSilent ? silentMs : 0);
  if (latest === null) return;
  const state = news(isSilent);
  for (const part of [showArrow, showFinder]) part(state);
  if (isSilent) return;
  document.documentElement.dataset.now = latest.status?.now_ns ?? '';
  for (const part of [showPlan, showCells, showCounters, showRuns, takeAnswer]) part(state);
}

connect();
document.documentElement.dataset.started = '';
document.addEventListener('themechange', redraw);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
setInterval(() => {
  const now = performance.now();
  if (now - heardMs > SILENT_MS) show();
  if (now - heardMs > LOST_MS && now - triedMs > LOST_MS) connect();
}, 500);
