// What came over the live connection, on the page. Texts from outside become text, never markup.

import { Alarms, alarmsOf } from './alarms.js';
import { Cards } from './cards.js';
import { ClusterChart, CorChart, SpeedChart } from './charts.js';
import { CorComparison, SpeedComparison } from './compare.js';
import { Cycles } from './cycles.js';
import { offerExports } from './exports.js';
import { Link } from './link.js';
import { Nodes } from './nodes.js';
import { drawNumbers } from './numbers.js';
import { Picture } from './picture.js';
import { TimeAxis } from './time_axis.js';
import * as words from './words.js';

const SERIES = ['speed', 'cor', 'cluster', 'truth'];
const SAY_EVERY_MS = 15000;
const NO_TRACKS_AFTER_MS = 2500;

const at = (id) => document.getElementById(id);
const trays = new Map();
const fromAddress = () => Number(/^#tray-(\d+)$/.exec(location.hash)?.[1]) || null;

let chosen = fromAddress();
let compared = location.hash === '#compare';
let namespace = '';
let columns = {};
let linked = 'waiting';
// The trays as they were when the page was frozen.
let frozen = null;
let pending = false;
let saidAt = 0;
let saidOf = '';
let lookedAt = performance.now();

const nodes = new Nodes(at('node-list'), at('no-nodes'), at('health'));
const alarms = new Alarms(at('alarms'));
const cards = new Cards(at('trays'), choose);
const picture = new Picture(at('canvas'), at('no-picture'));
const cycles = new Cycles(at('cycles'), at('finals'), () => showOther());
const axis = new TimeAxis();
const comparedAxis = new TimeAxis();
const speeds = new SpeedChart(at('speed-chart'), axis);
const cors = new CorChart(at('cor-chart'), axis);
const clusters = new ClusterChart(at('cluster-chart'), axis);
const comparedCors = new CorComparison(at('cor-comparison'));
const comparedSpeeds = new SpeedComparison(at('speed-comparison'), comparedAxis);
const charts = [speeds, cors, clusters];

const link = new Link({
  greeted(said) {
    namespace = said.namespace;
    columns = said.columns;
    at('namespace').textContent = namespace;
    at('version').textContent = `nanorocks_ros ${said.version}`;
    trays.clear();
    cycles.close();
    nodes.forget();
  },
  step(said) {
    for (const [number, told] of Object.entries(said.trays ?? {})) take(Number(number), told);
    if (said.nodes) nodes.take(said.nodes);
    drawSoon();
  },
  picture: (buffer) => frozen || picture.take(buffer).catch(() => {}),
  state(state) {
    linked = state;
    document.body.dataset.link = state;
    drawSoon();
  },
});

function take(number, told) {
  const before = trays.get(number);
  const rows = before && before.serial === told.serial ? before.rows : Object.fromEntries(SERIES.map((name) => [name, []]));
  for (const name of SERIES) {
    if (told[name]) {
      rows[name].length = Math.min(rows[name].length, told[name].from);
      rows[name].push(...told[name].rows);
    }
  }
  trays.set(number, { finals: before?.finals ?? [], past: before?.past ?? [], ...told, rows, heardAt: performance.now() - 1e3 * told.age });
}

const silentFor = (tray) => (performance.now() - tray.heardAt) / 1e3;

function drawSoon() {
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => {
    pending = false;
    draw();
  });
}

function draw() {
  if (trays.size > 0 && !trays.has(chosen)) chosen = Math.min(...trays.keys());
  const shown = frozen ?? trays;
  const tray = shown.get(chosen);
  const comparing = compared && shown.size > 1;
  at('nothing').hidden = !!tray;
  at('comparison').hidden = !comparing;
  at('compare').hidden = trays.size < 2;
  at('compare').setAttribute('aria-pressed', String(comparing));
  at('detail').hidden = !tray || comparing;
  cards.draw(trays, comparing ? null : chosen, silentFor);
  nodes.draw();
  const all = nodes.now();
  alarms.draw(alarmsOf(all));
  drawLink(all);
  look();
  if (comparing) {
    document.title = 'Trays compared, NanoRocks';
    comparedCors.draw(shown);
    comparedSpeeds.draw(shown);
  } else if (tray) {
    drawTray(cycles.viewOf(chosen, tray), tray);
  }
}

/** Whether results come; a node that only shows them says nothing of that. */
function drawLink(all) {
  const measuring = all.filter(({ name }) => !name.endsWith('/dashboard'));
  const [state, text] = words.linkState(linked, measuring, [...trays.values()], silentFor);
  at('link').dataset.state = state;
  if (at('link').textContent !== text) at('link').textContent = text;
}

function drawClock() {
  const now = new Date();
  at('clock').textContent = now.toLocaleTimeString('en-GB');
  at('clock').dateTime = now.toISOString();
  at('clock').title = `${now.toISOString().slice(0, 19).replace('T', ' ')} UTC`;
}

/** A tray as it is shown, in a cycle that is over or in the one that runs now. */
function drawTray(tray, running) {
  const silent = frozen ? 0 : silentFor(tray);
  const [state, text] = words.trayState(tray, silent);
  const flagged = words.flags(tray.latest).map((flag) => `, ${flag}`).join('');
  at('title').textContent = `Tray ${chosen}`;
  at('about').textContent = tray.description;
  at('state').dataset.state = flagged && state === 'ok' ? 'warning' : state;
  at('state').textContent = text + flagged + (frozen ? `, frozen at ${frozen.at}` : '');
  at('state').title = words.flagTexts(tray.latest);
  at('canvas').setAttribute('aria-label', `Picture of tray ${chosen}${pressed('tracks') ? ' with its tracks' : ''}`);
  document.title = `Tray ${chosen}, NanoRocks`;
  drawNumbers(tray);
  drawPriors(chosen);
  at('picture').hidden = tray !== running;
  if (tray !== running) at('panels').dataset.shape = 'none';
  coverTimes(tray);
  for (const chart of charts) chart.draw(tray);
  cycles.draw(chosen, running);
  for (const one of document.querySelectorAll('.only-truth')) one.hidden = !tray.latest.truth;
  sayNow(tray, text.replace(/ for \d+ s$/, ''));
}

/** All plots of a tray show the same time: from its shaking event to its last result. */
function coverTimes({ rows, start }) {
  const curves = [rows.speed, rows.cor, rows.cluster, rows.truth].filter((some) => some.length > 0);
  const ends = curves.flatMap((some) => [some[0][0], some[some.length - 1][0]]).map((time) => time - (start ?? 0));
  if (ends.length) axis.cover(Math.min(...ends, ...(words.known(start) ? [0] : [])), Math.max(...ends));
}

function drawPriors(number) {
  const priors = nodes.priorsOf(number, namespace);
  at('priors').hidden = !priors;
  at('priors').textContent = priors ? `Assumed before anything is measured (priors): ${priors.replaceAll('+-', '±')}` : '';
}

/** For those who listen: what changed, and the estimate now and then. */
function sayNow(tray, text) {
  const cor = tray.latest.cor;
  const of = `${chosen} ${tray.cycle} ${cor?.status}`;
  if (of === saidOf && performance.now() - saidAt < SAY_EVERY_MS) return;
  const value = words.saysSomething(cor)
    ? `, restitution ${words.restitution(cor.restitution)}, between ${words.restitution(cor.restitution_lower)} and ${words.restitution(cor.restitution_upper)}, ${words.corState(cor)}`
    : '';
  saidOf = of;
  saidAt = performance.now();
  at('said').textContent = `Tray ${chosen}, ${text}${value}`;
}

const pressed = (id) => at(id).getAttribute('aria-pressed') === 'true';

/** Ask for the pictures that are shown, and for none in a window that nobody sees. */
function look() {
  if (document.hidden || compared || frozen || cycles.opened || !trays.has(chosen)) {
    link.lookAt(null);
    return;
  }
  const layers = pressed('motion') ? ['motion'] : [];
  layers.push(pressed('tracks') ? 'tracks' : 'tray');
  const waited = performance.now() - lookedAt > NO_TRACKS_AFTER_MS;
  // Where no beads are followed there are no pictures of tracks.
  if (pressed('tracks') && waited && !picture.fresh('tracks')) layers.push('tray');
  picture.look(chosen, layers);
  link.lookAt({ tray: chosen, layers });
}

function choose(tray) {
  if (!trays.has(tray)) return;
  chosen = tray;
  compared = false;
  cycles.close();
  history.replaceState(null, '', `#tray-${tray}`);
  showOther();
}

/** All trays beside each other, or one of them again. */
function compare() {
  compared = !compared;
  history.replaceState(null, '', compared ? '#compare' : `#tray-${chosen}`);
  showOther();
}

/** Begin with other curves: in another tray, or in another cycle. */
function showOther() {
  lookedAt = performance.now();
  axis.part = null;
  for (const chart of charts) chart.show(null, '');
  drawSoon();
}

/** What is shown stays, while measuring goes on; or it follows again. */
function freeze() {
  frozen = frozen ? null : structuredClone(trays);
  if (frozen) frozen.at = new Date().toLocaleTimeString('en-GB');
  at('freeze').setAttribute('aria-pressed', String(!!frozen));
  document.body.dataset.frozen = frozen ? 'yes' : '';
  drawSoon();
}

/** The part of a curve that is shown, with the columns of the tables. */
function tableOf(name) {
  const tray = cycles.viewOf(chosen, (frozen ?? trays).get(chosen));
  const [low, high] = axis.shown.map((time) => time + (tray.start ?? 0));
  return [columns[name], tray.rows[name].filter((row) => row[0] >= low && row[0] <= high)];
}

function swatch(className, text) {
  const shown = document.createElement('span');
  const mark = document.createElement('span');
  mark.className = `swatch ${className}`;
  shown.append(mark, text);
  return shown;
}

function drawKey() {
  at('picture-key').replaceChildren(
    ...(pressed('tracks') ? [swatch('hidden-bead', 'hidden bead')] : []),
    ...(pressed('motion') ? [swatch('moving', 'moving')] : []),
  );
}

const trayName = () => `tray_${chosen}_cycle_${cycles.viewOf(chosen, (frozen ?? trays).get(chosen)).cycle}`;
for (const [name, chart] of [['speed', speeds], ['cor', cors], ['cluster', clusters]]) {
  offerExports(at(`${name}-chart`), chart, trayName, () => tableOf(name));
}
for (const [id, chart] of [['cor-comparison', comparedCors], ['speed-comparison', comparedSpeeds]]) {
  offerExports(at(id), chart, () => 'trays', () => chart.table());
}
for (const box of document.querySelectorAll('.zoom')) {
  const zoomed = box.dataset.of === 'compared' ? comparedAxis : axis;
  box.querySelector('.in').addEventListener('click', () => zoomed.zoom(1 / 1.5));
  box.querySelector('.out').addEventListener('click', () => zoomed.zoom(1.5));
  box.querySelector('.whole').addEventListener('click', () => zoomed.reset());
}
at('freeze').addEventListener('click', freeze);
at('compare').addEventListener('click', compare);

for (const id of ['tracks', 'motion', 'log']) {
  at(id).addEventListener('click', () => {
    at(id).setAttribute('aria-pressed', String(!pressed(id)));
    if (id === 'log') speeds.setLog(pressed('log'));
    lookedAt = performance.now();
    drawKey();
    drawSoon();
  });
}

document.addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches('input, textarea')) return;
  const order = [...trays.keys()].sort((a, b) => a - b);
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step && order.length) {
    event.preventDefault();
    choose(order[(order.indexOf(chosen) + step + order.length) % order.length]);
    if (event.target.matches('.card')) document.querySelector(`.card[aria-keyshortcuts="${chosen}"]`)?.focus();
  } else if (/^[0-9]$/.test(event.key)) {
    choose(Number(event.key));
  } else if (event.key === 'c' && trays.size > 1) {
    compare();
  } else if (event.key === 'f') {
    freeze();
  }
});

window.addEventListener('hashchange', () => {
  if (location.hash === '#compare') {
    if (!compared) compare();
  } else if (fromAddress()) choose(fromAddress());
});
document.addEventListener('visibilitychange', look);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  for (const chart of [...charts, comparedCors, comparedSpeeds]) chart.renew();
});
setInterval(() => {
  drawClock();
  drawSoon();
}, 1000);
drawClock();
drawKey();
