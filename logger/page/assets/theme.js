// Colours: as the phone is set, light, dark, or red on black for the night.

const THEMES = {auto: 'automatic', light: 'light', dark: 'dark', night: 'night'};
const button = document.getElementById('theme');
const root = document.documentElement;

function choose(name) {
  root.dataset.theme = name;
  button.textContent = `Colours: ${THEMES[name]}`;
}

/** A browser that stores nothing (private, cookies blocked) refuses with an exception. */
function stored(action) {
  try { return action(); } catch { return null; }
}

button.addEventListener('click', () => {
  const names = Object.keys(THEMES);
  const name = names[(names.indexOf(root.dataset.theme) + 1) % names.length];
  stored(() => localStorage.setItem('theme', name));
  choose(name);
  document.dispatchEvent(new Event('themechange'));
});
const kept = stored(() => localStorage.getItem('theme'));
choose(kept in THEMES ? kept : 'auto');
