// Numbers that show that the recording is sound, and the runs to take home.

import {isFresh} from './geometry.js';

const byId = id => document.getElementById(id);
const LOW_BYTES = 1e9;
// a run is closed some time after the next one has begun, or the service has stopped
const RUNS_MS = 15000;
let shownRun = null;
let askedMs = 0;
let shownRuns = '';

function counters({status, machine, silent_s: silentS, n_cells: nCells}) {
  const fix = isFresh(status?.fix, status?.now_ns) ? status.fix : null;
  const durableS = status?.synced_ns == null ? null : (status.now_ns - status.synced_ns) / 1e9 + silentS;
  const free = machine.free_bytes;
  return [
    ['fixes', status?.fixes], ['satellites', fix?.sats_used],
    ['accuracy', fix?.acc_m != null ? `${fix.acc_m.toFixed(0)} m` : fix?.hdop != null ? `HDOP ${fix.hdop}` : null],
    ['scans', status?.scans], ['readings', status?.readings], ['cells', nCells],
    ['on the card', durableS === null ? null : `${durableS.toFixed(0)} s ago`],
    ['free', free == null ? null : `${(free / 1e9).toFixed(1)} GB${free < LOW_BYTES ? ', low!' : ''}`],
    ['waiting', status?.waiting],
    ['temperature', machine.temperature_c == null ? null : `${machine.temperature_c.toFixed(0)} °C`],
    ['battery', batteryText(status?.battery)],
    ['undervoltage', machine.undervoltage], ['run', status?.run.match(/(\d+)\.journal/)?.[1]],
  ];
}

function batteryText(battery) {
  if (battery?.percent != null) return `${battery.percent.toFixed(0)} %`;
  return battery?.volts != null ? `${battery.volts.toFixed(2)} V` : null;
}

export function showCounters(state) {
  const list = byId('counters');
  counters(state).forEach(([name, value], i) => {
    let box = list.children[i];
    if (!box) {
      box = document.createElement('div');
      box.append(document.createElement('dt'), document.createElement('dd'));
      list.append(box);
    }
    const [dt, dd] = box.children;
    dt.textContent = name;
    dd.textContent = value ?? '–';
  });
}

export async function showRuns({status}) {
  const run = status?.run ?? '';
  if (run === shownRun && performance.now() - askedMs < RUNS_MS) return;
  shownRun = run;
  askedMs = performance.now();
  const reply = await fetch('runs').catch(() => null);
  if (!reply?.ok) { shownRun = null; return; }
  const text = await reply.text();
  if (text === shownRuns) return; // a link that is made anew loses its tap
  shownRuns = text;
  const links = JSON.parse(text).map(([name, bytes]) => {
    const link = document.createElement('a');
    link.href = `runs/${name}`;
    link.download = name;
    link.textContent = `${name}, ${(bytes / 1e6).toFixed(1)} MB`;
    return Object.assign(document.createElement('li'), {}).appendChild(link).parentElement;
  });
  if (links.length) byId('runs').replaceChildren(...links);
}
