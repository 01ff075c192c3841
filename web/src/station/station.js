// The ground station's page: what perch-live tells of its run, live and back over five minutes.
import {element} from '../common/element.js';
import {fixed} from '../common/format.js';
import {STATUSES} from '../common/names.js';
import {BinaryView} from '../views/binary.js';
import {unpackBits} from '../views/bits.js';
import {PictureView} from '../views/picture.js';
import {saveCsv, savePng} from './export.js';
import {listenToKeys} from './keys.js';
import {Link} from './link.js';
import {LivePlots} from './live_plots.js';
import {Numerals} from './numerals.js';
import {Status} from './status.js';
import {Store} from './store.js';

const STRETCHES = [10, 30, 60, 300];  // s
// Plots five times a second: more tires a phone and no eye sees it.
const DRAW_MS = 200;
// Without a row for so long what is shown is no more how it is.
const OLD_MS = 1000;
const PAD_OF_SOURCE = ['SEARCH', 'TRACK', 'COAST', 'LOST'];

const store = new Store();
const link = new Link(store);
const numerals = new Numerals();
const status = new Status();
const picture = new PictureView();
const binary = new BinaryView();

/** @type {any} */ let hello = null;
/** @type {any} */ let run = null;          // the last status
/** @type {Record<string, number>} */ let column = {};
/** @type {import('../views/scene.js').Scene|null} */ let scene = null;
let sceneTools = null;
let pausedAt = null;                        // s; null: live
let stretch = STRETCHES[1];
let lastRowMs = 0, lastFailure = '', rate = 0;
let shownPicture = null;
let stale = true;

// ---- the page ----

const button = (id, words, title, action, more = {}) => element('button', {id, type: 'button', title, onclick: action, ...more}, words);
const badge = element('strong', {id: 'badge', role: 'status', 'aria-live': 'polite'}, 'SEARCH');
const title = element('span', {class: 'title'}, 'Perch');
const connection = element('span', {id: 'connection'}, 'connecting');
const pauseButton = button('pause', 'Pause', 'Pause (space)', togglePause);
const slider = /** @type {HTMLInputElement} */ (element('input', {id: 'slider', type: 'range', min: '-300', max: '0', step: '0.05', value: '0', 'aria-label': 'time before now, s', oninput: () => pauseAt((store.last?.t ?? 0) + Number(slider.value))}));
const when = element('output', {id: 'when'}, 'live');
const stretchButton = button('stretch', `${stretch} s`, 'Stretch of the plots (w)', nextStretch);
const recordButton = button('record', 'Record', 'Start or stop recording (r)', toggleRecording, {hidden: ''});
const markButton = button('mark', 'Mark', 'Mark an event (m)', mark, {hidden: ''});
const centreButton = button('centre', 'Centre', 'Centre the head (h)', () => link.send({do: 'centre'}), {hidden: ''});
const closeButton = button('close', 'Close-up', 'The target alone (z)', toggleClose, {'aria-pressed': 'false'});
const sceneCard = element('div', {class: 'card scene-card'}, element('h2', {}, '3-D'));
const livePlots = new LivePlots(pauseAt);
const plotsPart = element('div', {class: 'plots'}, livePlots.element);

document.getElementById('station')?.append(
    element('header', {},
        badge, element('div', {class: 'about'}, title, connection),
        element('nav', {}, recordButton, markButton, centreButton, button('csv', 'CSV', 'The rows seen as CSV (s)', exportCsv), button('png', 'PNG', 'The page as PNG (p)', exportPng),
            button('theme', '◐', 'Dark or light (t)', toggleTheme, {'aria-label': 'dark or light'}), button('help', '?', 'Keys (?)', () => help.toggle()))),
    numerals.element,
    element('div', {class: 'views'},
        element('div', {class: 'card'}, element('div', {class: 'cap'}, element('h2', {}, 'Camera'), closeButton), picture.element,
            element('p', {class: 'note'}, 'Residuals of the edges ×60, σ of the pad’s centre in yellow.')),
        sceneCard,
        element('div', {class: 'side'}, element('div', {class: 'card'}, element('h2', {}, 'Black and white'), binary.element), status.eventsElement),
        status.element),
    plotsPart,
    element('footer', {}, pauseButton, slider, when, stretchButton));

// ---- what came ----

link.addEventListener('hello', (event) => {
  hello = /** @type {CustomEvent} */ (event).detail;
  column = Object.fromEntries(hello.columns.map((name, i) => [name, i]));
  title.textContent = (hello.recorded ? 'replay of ' : '') + hello.title;
  document.title = `Perch: ${hello.title}`;
  status.clearEvents();
  for (const one of [recordButton, markButton]) one.toggleAttribute('hidden', !hello.control);
  centreButton.toggleAttribute('hidden', !hello.control || !hello.pan_tilt);
  livePlots.setHead(!!hello.pan_tilt);
  scene?.setPad(hello.pad);
  connection.textContent = 'connected';
  connection.className = 'ok';
  stale = true;
});
link.addEventListener('lost', () => {
  connection.textContent = 'connection lost, trying again';
  connection.className = 'bad';
  stale = true;
});
// What was seen stays to be looked at until somebody goes there.
link.addEventListener('logged out', () => connection.replaceChildren(element('a', {href: '/login.html'}, 'log in again')));
link.addEventListener('rows', () => {
  lastRowMs = performance.now();
  for (const row of store.rows.slice(-30)) if (row.status) lastFailure = `${STATUSES[row.status].words} at ${fixed(row.t, 2)} s`;
  stale = true;
});
link.addEventListener('picture', () => {
  const last = store.pictures[store.pictures.length - 1];
  if (last.overlay.problem) lastFailure = last.overlay.problem;
  stale = true;
});
link.addEventListener('status', (event) => {
  run = /** @type {CustomEvent} */ (event).detail;
  recordButton.textContent = run.recording.on ? 'Stop' : 'Record';
  recordButton.classList.toggle('on', run.recording.on);
  stale = true;
});
link.addEventListener('event', (event) => status.addEvent(/** @type {CustomEvent} */ (event).detail));

// The largest part of the page comes last.
import('./scene_tools.js').then((tools) => {
  sceneTools = tools;
  scene = new tools.Scene();
  sceneCard.append(scene.element);
  if (hello) scene.setPad(hello.pad);
  stale = true;
});

// ---- what is shown ----

function draw() {
  const old = pausedAt == null && performance.now() - lastRowMs > OLD_MS;
  if (!hello || (!stale && !old)) return;
  stale = false;
  const newest = store.last?.t ?? 0;
  const t = pausedAt ?? newest;
  const row = store.rowAt(t);
  showBadge(row, old);
  numerals.show(row, column, old || !link.connected);
  const seen = store.pictureAt(t);
  showPicture(seen);
  status.showRow(row, column, seen, hello);
  if (run) status.showStatus(run, lastFailure);
  const to = pausedAt == null ? newest : Math.min(newest, t + stretch / 2), from = to - stretch;
  const rows = store.between(from, to);
  livePlots.show(rows, column, from, to);
  if (scene && sceneTools) sceneTools.showRow(scene, hello, row, rows, column);
  slider.value = String(t - newest);
  when.textContent = pausedAt == null ? 'live' : `${fixed(t - newest, 1)} s`;
  pauseButton.textContent = pausedAt == null ? 'Pause' : 'Live';
  document.body.classList.toggle('paused', pausedAt != null);
}

function showBadge(row, old) {
  // The server sees that no frame comes any more; a row is of the frame that came.
  const words = !link.connected ? 'NO LINK' : pausedAt == null && run && old ? run.pad : PAD_OF_SOURCE[row?.source ?? 0];
  if (badge.textContent !== words) badge.textContent = words;
  badge.className = words.replace(' ', '').toLowerCase();
}

async function showPicture(seen) {
  if (seen === shownPicture) return;
  shownPicture = seen;
  binary.show(seen?.bits ? unpackBits(seen.bits) : null);
  const image = seen?.jpeg ? await createImageBitmap(seen.jpeg).catch(() => null) : null;
  if (seen !== shownPicture) return image?.close();
  const before = picture.image;
  picture.show(image, seen?.overlay ?? null);
  if (before instanceof ImageBitmap) before.close();
}

setInterval(draw, DRAW_MS);
setInterval(() => {
  rate = 0.7 * rate + 0.3 * link.bytes * 8e-3;
  link.bytes = 0;
  if (link.connected) connection.textContent = `${rate.toFixed(0)} kbit/s`;
}, 1000);

// ---- what is asked for ----

function pauseAt(t) {
  pausedAt = Math.max(store.rows[0]?.t ?? 0, Math.min(t, store.last?.t ?? 0));
  stale = true;
}
function togglePause() {
  if (pausedAt == null) pauseAt(store.last?.t ?? 0);
  else goLive();
}
function goLive() {
  pausedAt = null;
  stale = true;
}
const step = (seconds) => (event) => pauseAt((pausedAt ?? store.last?.t ?? 0) + (event.shiftKey ? 10 : 1) * seconds);
function nextStretch() {
  stretch = STRETCHES[(STRETCHES.indexOf(stretch) + 1) % STRETCHES.length];
  stretchButton.textContent = `${stretch} s`;
  stale = true;
}
function toggleClose() {
  link.setView({close: !link.view.close});
  closeButton.setAttribute('aria-pressed', String(link.view.close));
}
function toggleTheme() {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;
  root.dataset.theme = dark ? 'light' : 'dark';
  recolour();
}
function recolour() {
  livePlots.draw();
  scene?.recolour();
  stale = true;
}
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', recolour);
const seenRows = () => {
  const to = pausedAt == null ? store.last?.t ?? 0 : Math.min(store.last?.t ?? 0, pausedAt + stretch / 2);
  return store.between(to - stretch, to);
};
function exportCsv() { if (hello) saveCsv(seenRows(), hello); }
function exportPng() { if (hello) savePng(document.getElementById('station'), store.last, hello); }
function toggleRecording() { if (hello?.control && run) link.send({do: run.recording.on ? 'stop' : 'record'}); }
function mark() {
  if (!hello?.control) return;
  const text = prompt('What happened?', '');
  if (text != null) link.send({do: 'mark', text: text.slice(0, 100)});
}
const layer = (name) => () => {
  picture.layers[name] = !picture.layers[name];
  picture.draw();
};

const help = listenToKeys([
  [' ', 'pause, and live again', togglePause],
  ['ArrowLeft', 'a tenth of a second back (with shift: one)', step(-0.1)],
  ['ArrowRight', 'forward', step(0.1)],
  ['End', 'live', goLive],
  ['w', 'stretch of the plots', nextStretch],
  ['z', 'close-up of the target', toggleClose],
  ['o', 'outline on and off', layer('outline')],
  ['e', 'edges and residuals', layer('edges')],
  ['l', 'labels', layer('labels')],
  ['t', 'dark or light', toggleTheme],
  ['s', 'save what is seen as CSV', exportCsv],
  ['p', 'save the views as PNG', exportPng],
  ['r', 'start or stop recording, where allowed', toggleRecording],
  ['m', 'mark an event, where allowed', mark],
  ['h', 'centre the head, where allowed', () => hello?.control && link.send({do: 'centre'})],
  ['?', 'these keys', () => help.toggle()],
]);
