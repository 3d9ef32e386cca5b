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

let latest = null;
let heardMs = performance.now();

function connect() {
  const source = new EventSource('live');
  source.onmessage = event => {
    heardMs = performance.now();
    latest = JSON.parse(event.data);
    show();
  };
  source.onerror = () => {
    if (source.readyState === EventSource.CLOSED) setTimeout(connect, AGAIN_MS);
  };
}

function show() {
  const silentMs = performance.now() - heardMs;
  showGlance(latest, silentMs > SILENT_MS ? silentMs : 0);
  if (latest === null || silentMs > SILENT_MS) return;
  document.documentElement.dataset.now = latest.status?.now_ns ?? '';
  for (const part of [showArrow, showFinder, showPlan, showCells, showCounters, showRuns, takeAnswer]) part(latest);
}

connect();
setInterval(() => { if (performance.now() - heardMs > SILENT_MS) show(); }, 500);
