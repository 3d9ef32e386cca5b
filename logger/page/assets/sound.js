// A tone whose pitch follows the level; silent until tapped, as browsers demand and walkers like.

const button = document.getElementById('sound');
const [LOW_DBM, HIGH_DBM] = [-110, -50];
let tone = null;

button.addEventListener('click', () => {
  if (tone) {
    tone.context.close();
    tone = null;
  } else {
    const context = new AudioContext();
    const oscillator = context.createOscillator();
    const volume = context.createGain();
    volume.gain.value = 0;
    oscillator.connect(volume).connect(context.destination);
    oscillator.start();
    tone = {context, oscillator, volume};
  }
  button.setAttribute('aria-pressed', String(tone !== null));
});

/** Hertz of a level: two octaves and a half from the weakest to the strongest. */
export function pitch(levelDbm) {
  const share = Math.max(0, Math.min(1, (levelDbm - LOW_DBM) / (HIGH_DBM - LOW_DBM)));
  return 220 * 2 ** (2.5 * share);
}

/** Sound the level; null is silence. */
export function soundLevel(levelDbm) {
  if (!tone) return;
  const now = tone.context.currentTime;
  tone.volume.gain.setTargetAtTime(levelDbm === null ? 0 : 0.2, now, 0.05);
  if (levelDbm !== null) tone.oscillator.frequency.setTargetAtTime(pitch(levelDbm), now, 0.05);
}
