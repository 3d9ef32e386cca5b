// A page without TLS has no wake lock: a playing film keeps the screen on. It is ten seconds of black and
// silence; Chromium ignores small films that are muted.

const button = document.getElementById('awake');
const film = document.getElementById('film');

button.addEventListener('click', async () => {
  const wanted = button.getAttribute('aria-pressed') !== 'true';
  if (wanted) await film.play().catch(() => {});
  else film.pause();
  button.setAttribute('aria-pressed', String(!film.paused));
});
document.addEventListener('visibilitychange', () => {
  if (!document.hidden && button.getAttribute('aria-pressed') === 'true') film.play().catch(() => {});
});
