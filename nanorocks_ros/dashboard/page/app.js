// What came over the live connection, on the page. Texts from outside become text, never markup.

import { Cards } from './cards.js';
import { ClusterChart, CorChart, SpeedChart } from './charts.js';
import { Link } from './link.js';
import { Nodes } from './nodes.js';
import { Picture } from './picture.js';
import * as words from './words.js';

const SERIES = ['speed', 'cor', 'cluster', 'truth'];
const SAY_EVERY_MS = 15000;
const NO_TRACKS_AFTER_MS = 2500;

const at = (id) => document.getElementById(id);
const trays = new Map();
const fromAddress = () => Number(/^#tray-(\d+)$/.exec(location.hash)?.[1]) || null;

let chosen = fromAddress();
let namespace = '';
let pending = false;
let saidAt = 0;
let saidOf = '';
let lookedAt = performance.now();

const nodes = new Nodes(at('node-list'), at('no-nodes'), at('health'));
const cards = new Cards(at('trays'), choose);
const picture = new Picture(at('canvas'), at('no-picture'));
const speeds = new SpeedChart(at('speed-chart'));
const cors = new CorChart(at('cor-chart'));
const clusters = new ClusterChart(at('cluster-chart'));

const link = new Link({
  greeted(said) {
    namespace = said.namespace;
    at('namespace').textContent = namespace;
    at('version').textContent = `nanorocks_ros ${said.version}`;
    trays.clear();
    nodes.forget();
  },
  step(said) {
    for (const [number, told] of Object.entries(said.trays ?? {})) take(Number(number), told);
    if (said.nodes) nodes.take(said.nodes);
    drawSoon();
  },
  picture: (buffer) => picture.take(buffer).catch(() => {}),
  state(state) {
    document.body.dataset.link = state;
    const shown = at('link');
    shown.dataset.state = { open: 'ok', lost: 'error' }[state];
    shown.textContent = { open: 'live', lost: 'connection lost, trying again' }[state];
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
  trays.set(number, { finals: before?.finals ?? [], ...told, rows, heardAt: performance.now() - 1e3 * told.age });
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
  const tray = trays.get(chosen);
  at('nothing').hidden = !!tray;
  at('detail').hidden = !tray;
  cards.draw(trays, chosen, silentFor);
  nodes.draw();
  look();
  if (tray) drawTray(tray);
}

function drawTray(tray) {
  const [state, text] = words.trayState(tray, silentFor(tray));
  const flagged = words.flags(tray.latest).map((one) => `, ${one}`).join('');
  at('title').textContent = `Tray ${chosen}`;
  at('about').textContent = tray.description;
  at('state').dataset.state = flagged && state === 'ok' ? 'warning' : state;
  at('state').textContent = text + flagged;
  at('state').title = words.flagTexts(tray.latest);
  at('canvas').setAttribute('aria-label', `Picture of tray ${chosen}${pressed('tracks') ? ' with its tracks' : ''}`);
  document.title = `Tray ${chosen}, NanoRocks`;
  drawNumbers(tray);
  drawPriors(chosen);
  speeds.draw(tray);
  cors.draw(tray);
  clusters.draw(tray);
  drawFinals(tray);
  for (const one of document.querySelectorAll('.only-truth')) one.hidden = !tray.latest.truth;
  sayNow(tray, text.replace(/ for \d+ s$/, ''));
}

/** A number with what is to be said of it below; or only that, while there is no number. */
function number(id, value, small) {
  const shown = at(id);
  const note = document.createElement('small');
  note.textContent = small;
  shown.classList.toggle('awaited-value', !value);
  shown.replaceChildren(...(value ? [value, note] : [small]));
}

function drawNumbers(tray) {
  const { cor, cluster, speed } = tray.latest;
  drawCor(tray);
  const wall = words.saysSomething(cor) && words.known(cor.wall_restitution);
  number(
    'walls',
    wall && words.restitution(cor.wall_restitution),
    wall ? words.interval(cor.wall_restitution_lower, cor.wall_restitution_upper, words.restitution) : 'not known yet',
  );
  number(
    'speed',
    speed && `${words.speed(speed.mean_projected_speed)} mm/s`,
    speed ? `${words.give(speed.mean_projected_speed_error, words.speed)} by ${speed.method.replaceAll('_', ' ')}` : 'no speed yet',
  );
  const fitted = cor && words.known(cor.haff_time);
  number('haff', fitted && `${cor.haff_time.toFixed(2)} s`, fitted ? words.give(cor.haff_time_error, (one) => one.toFixed(2), ' s') || 'of the fit' : 'no fit yet');
  const size = cluster && words.known(cluster.combined_size);
  number(
    'cluster',
    size && cluster.combined_size.toFixed(2),
    size ? `beads per body ${words.give(cluster.combined_size_error, (one) => one.toFixed(2))}` : 'not known yet',
  );
  number('sticking', ...(cluster ? words.sticking(cluster) : ['', 'not known yet']));
  number('drag', ...words.drag(cor));
  number('acceleration', ...words.acceleration(cor));
  number('exponent', ...words.exponent(cor));
}

function drawPriors(number) {
  const priors = nodes.priorsOf(number, namespace);
  at('priors').hidden = !priors;
  at('priors').textContent = priors ? `Assumed before anything is measured (priors): ${priors.replaceAll('+-', '±')}` : '';
}

const final = ([, value, lower, upper]) =>
  words.known(value) ? `${words.restitution(value)} ${words.interval(lower, upper, words.restitution)}` : 'no estimate';

function drawCor({ latest: { cor }, start, finals }) {
  if (!words.saysSomething(cor)) {
    const last = finals[finals.length - 1];
    const before = last && words.known(last[1]) ? `; cycle ${last[0]}: ${final(last)}` : '';
    const awaited = start === null ? 'no shaking event yet' : 'no estimate yet';
    number('cor', '', (cor ? words.corState(cor) : awaited) + before);
    return;
  }
  const shown = at('cor');
  const bounds = document.createElement('span');
  bounds.className = 'interval';
  bounds.textContent = words.interval(cor.restitution_lower, cor.restitution_upper, words.restitution);
  const note = document.createElement('small');
  const contacts = cor.rebounds + cor.collisions;
  note.textContent = words.corState(cor) + words.source(cor, contacts);
  shown.classList.remove('awaited-value');
  shown.replaceChildren(`${words.restitution(cor.restitution)} `, bounds, note);
}

function drawFinals(tray) {
  at('cycles').hidden = tray.finals.length === 0;
  const list = at('finals');
  const texts = tray.finals.map((one) => `Cycle ${one[0]}: ${words.known(one[1]) ? 'COR ' : ''}${final(one)}`);
  const { mean_restitution: mean, mean_restitution_error: error } = tray.latest.cor ?? {};
  if (tray.finals.length > 1 && words.known(mean)) {
    texts.push(`Mean: COR ${words.restitution(mean)} ${words.give(error, words.restitution)}`);
  }
  if (list.dataset.shown === texts.join('\n')) return;
  list.dataset.shown = texts.join('\n');
  list.replaceChildren(
    ...texts.map((text) => {
      const item = document.createElement('li');
      item.textContent = text;
      return item;
    }),
  );
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
  if (document.hidden || !trays.has(chosen)) {
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
  lookedAt = performance.now();
  history.replaceState(null, '', `#tray-${tray}`);
  for (const one of [speeds, cors, clusters]) one.show(null, '');
  drawSoon();
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
  }
});

window.addEventListener('hashchange', () => fromAddress() && choose(fromAddress()));
document.addEventListener('visibilitychange', look);
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
  for (const one of [speeds, cors, clusters]) one.renew();
});
setInterval(drawSoon, 1000);
drawKey();
