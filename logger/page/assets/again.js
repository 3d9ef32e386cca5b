// A page of which a part did not come, over a poor Wi-Fi, would connect to the Pi for ever.

const AGAIN_MS = 2000;
addEventListener('load', () => {
  if (!('started' in document.documentElement.dataset)) setTimeout(() => location.reload(), AGAIN_MS);
});
