// The ground under the plan: MapLibre draws a PMTiles file that is on the Pi.

const EARTH_M = 40075016.686;
const TILE_PX = 512;
// names of layers in Protomaps' and OpenMapTiles' files
const WATER = ['water', 'waterway'];
const ROADS = ['roads', 'transportation'];
const BUILDINGS = ['buildings', 'building'];
const box = document.getElementById('ground');
let state = 'none';
let map = null;
let look = '';

/** Show the ground in this projection; false while there is no map. */
export function showGround(hasMap, centre, perPixelM, colour) {
  if (!hasMap || state === 'failed') return false;
  if (state === 'none') {
    state = 'loading';
    start(colour).then(() => { state = 'ready'; }, () => { state = 'failed'; box.replaceChildren(); });
  }
  if (state !== 'ready') return false;
  const zoom = Math.log2(EARTH_M * Math.cos(centre.lat * Math.PI / 180) / (TILE_PX * perPixelM));
  map.jumpTo({center: [centre.lon, centre.lat], zoom});
  restyle(colour);
  return true;
}

async function start(colour) {
  await Promise.all([loaded('script', {src: 'pmtiles.js'}), loaded('link', {rel: 'stylesheet', href: 'maplibre-gl.css'})]);
  const {Map, addProtocol} = await import('./maplibre-gl.mjs');
  const file = new window.pmtiles.PMTiles(new URL('map', location).href);
  const protocol = new window.pmtiles.Protocol();
  protocol.add(file);
  addProtocol('pmtiles', protocol.tile);
  const [header, metadata] = [await file.getHeader(), await file.getMetadata()];
  const attribution = new DOMParser().parseFromString(metadata?.attribution ?? '', 'text/html').body.textContent;
  document.getElementById('attribution').textContent = attribution && `Map: ${attribution}`;
  map = new Map({container: box, interactive: false, attributionControl: false, fadeDuration: 0,
    style: style(file.source.getKey(), header, metadata, colour)});
  await new Promise((done, failed) => { map.once('load', done); setTimeout(failed, 20000); });
}

function loaded(tag, attributes) {
  const element = Object.assign(document.createElement(tag), attributes);
  document.head.append(element);
  return new Promise((done, failed) => { element.onload = done; element.onerror = failed; });
}

function style(address, header, metadata, colour) {
  const url = `pmtiles://${address}`;
  const isVector = header.tileType === 1;
  const ground = {type: isVector ? 'vector' : 'raster', url, tileSize: isVector ? 512 : 256};
  const known = new Set((metadata?.vector_layers ?? []).map(layer => layer.id));
  const layer = (type, paint) => name => ({id: name, type, source: 'ground', 'source-layer': name, paint});
  const layers = !isVector ? [{id: 'picture', type: 'raster', source: 'ground', paint: {'raster-opacity': 0.6}}]
    : [...WATER.map(layer('fill', {'fill-opacity': 0.25})),
      ...BUILDINGS.map(layer('fill', {'fill-opacity': 0.6})), ...ROADS.map(layer('line', {'line-width': 2}))]
      .filter(one => known.size === 0 || known.has(one['source-layer']));
  look = '';
  return {version: 8, sources: {ground}, layers: [{id: 'paper', type: 'background',
    paint: {'background-color': colour('paper')}}, ...layers]};
}

/** The colours of the page, which the walker may change. */
function restyle(colour) {
  const wanted = ['paper', 'line', 'cell', 'soft'].map(colour).join();
  if (wanted === look) return;
  look = wanted;
  const paint = (names, property, name) => {
    for (const id of names) if (map.getLayer(id)) map.setPaintProperty(id, property, colour(name));
  };
  paint(['paper'], 'background-color', 'paper');
  paint(WATER, 'fill-color', 'cell');
  paint(BUILDINGS, 'fill-color', 'line');
  paint(ROADS, 'line-color', 'line');
}
