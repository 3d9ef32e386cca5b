// Canvases in the colours of the style sheet, sharp on any screen.

const STOPS = ['l0', 'l1', 'l2', 'l3', 'l4'];
const LEVELS_DBM = [-105, -60];

export function prepared(canvas) {
  const box = canvas.getBoundingClientRect();
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [box.width, box.height];
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const g = canvas.getContext('2d');
  g.scale(scale, scale);
  const style = getComputedStyle(document.documentElement);
  return {g, width, height, colour: name => style.getPropertyValue(`--${name}`).trim()};
}

/** Name of the colour of a level: five steps from weak to strong. */
export function stopOf(levelDbm) {
  const share = (levelDbm - LEVELS_DBM[0]) / (LEVELS_DBM[1] - LEVELS_DBM[0]);
  return STOPS[Math.max(0, Math.min(4, Math.floor(share * 5)))];
}
