// The viewer sends requests for releases and statistics to other machines. This script answers them
// within the page with an empty response: none leaves this machine, and none fails.
// It then opens the recording that is served beside it.
"use strict";
(() => {
  const here = (resource) => {
    const url = new URL(resource instanceof Request ? resource.url : resource, location.href);
    return !url.protocol.startsWith("http") || url.origin === location.origin;
  };

  const fetchHere = window.fetch.bind(window);
  window.fetch = (resource, options) =>
    here(resource) ? fetchHere(resource, options) : Promise.resolve(new Response(null, { status: 204 }));

  const { open, send } = XMLHttpRequest.prototype;
  const elsewhere = new WeakSet();
  XMLHttpRequest.prototype.open = function (method, url, ...rest) {
    if (!here(url)) elsewhere.add(this);
    return open.call(this, method, here(url) ? url : location.href, ...rest);
  };
  XMLHttpRequest.prototype.send = function (body) {
    if (!elsewhere.has(this)) send.call(this, body);
  };
  navigator.sendBeacon = () => true;

  console.debug = () => {}; // tens of thousands of lines from the shader compiler

  if (location.search === "") {
    const recording = encodeURIComponent(`${location.origin}/run.rrd`);
    history.replaceState(null, "", `?url=${recording}&theme=dark&hide_welcome_screen&persist=0`);
  }
})();
