// How every node is, in its own words.

import { duration } from './words.js';

const SILENT_S = 3.5;
const WAITING = 'frames waiting for the trays';
// Of the thirty that may wait before frames are lost.
const MANY_WAITING = 15;
// What a node receives, and how fast, says nothing of one that only publishes.
const isSource = (all) => all.get('received') === '0' && Number(all.get('published')) > 0;
const RATES = [
  ['rate [1/s]', (value, all) => (isSource(all) ? `${all.get('published')} published` : `${value} messages/s`)],
  ['processing, mean [ms]', (value) => `${value} ms each`],
  ['refused', (value) => (value === '0' ? '' : `${value} refused`)],
  ['picture, since the camera took it [ms]', (value) => `pictures ${value} ms old`],
  [WAITING, (value) => `${value} ${value === '1' ? 'frame' : 'frames'} waiting`],
];

const colour = (state) => (['silent', 'behind'].includes(state) ? 'warning' : state);

function element(name, className) {
  const one = document.createElement(name);
  if (className) one.className = className;
  return one;
}

export class Nodes {
  constructor(list, note, health) {
    Object.assign(this, { list, note, health });
    this.shown = new Map();
    this.nodes = [];
    this.heardAt = 0;
  }

  /** A server that was started again knows of other nodes. */
  forget() {
    this.nodes = [];
  }

  take(nodes) {
    this.nodes = nodes;
    this.heardAt = performance.now();
  }

  /** The priors of the node of this graph that estimates the restitutions of a tray. */
  priorsOf(tray, namespace) {
    for (const { name, values } of this.nodes) {
      const known = new Map(values);
      const home = name.slice(0, name.lastIndexOf('/')) || '/';
      if (home === namespace && known.has(`tray ${tray} COR`) && known.has('priors')) return known.get('priors');
    }
    return '';
  }

  /** The nodes with their states now. */
  now() {
    const since = (performance.now() - this.heardAt) / 1e3;
    return this.nodes.map((node) => {
      const age = node.age + since;
      const waiting = Number(node.values.find(([key]) => key === WAITING)?.[1]);
      const behind = node.level === 'ok' && waiting >= MANY_WAITING;
      return { ...node, age, state: age > SILENT_S ? 'silent' : behind ? 'behind' : node.level };
    });
  }

  draw() {
    const states = this.now().map(({ state, age }) => [state, age]);
    this.nodes.forEach((node, index) => this.drawOne(node, index, ...states[index]));
    for (const [name, one] of this.shown) {
      if (!this.nodes.some((node) => node.name === name)) {
        one.item.remove();
        this.shown.delete(name);
      }
    }
    this.note.hidden = this.nodes.length > 0;
    this.drawHealth(states.map(([state]) => state));
  }

  drawHealth(states) {
    const count = (state) => states.filter((one) => one === state).length;
    const bad = ['error', 'warning', 'silent', 'behind'].filter((state) => count(state) > 0);
    const words = bad.map((state) => `${count(state)} ${state}`);
    this.health.dataset.state = bad.length ? colour(bad[0]) : states.length ? 'ok' : 'waiting';
    const well = states.length === 1 ? '1 node, well' : `${states.length} nodes, all well`;
    const text = states.length ? words.join(', ') || well : 'no node heard yet';
    if (this.health.textContent !== text) this.health.textContent = text;
  }

  drawOne(node, index, state, age) {
    const one = this.shown.get(node.name) ?? this.make(node.name);
    const there = this.list.children[index];
    if (there !== one.item) this.list.insertBefore(one.item, there ?? null);
    one.level.dataset.state = colour(state);
    const words = { ok: 'well', behind: 'falls behind', silent: `silent for ${duration(age)}` };
    one.level.textContent = words[state] ?? state;
    one.text.textContent = ['ok', 'behind', 'silent'].includes(state) && node.text === 'working' ? '' : node.text;
    const values = new Map(node.values);
    const rates = RATES.filter(([key]) => values.get(key))
      .map(([key, show]) => show(values.get(key), values))
      .filter(Boolean)
      .join(' · ');
    one.rates.textContent = state === 'silent' && rates ? `before: ${rates}` : rates;
    if (one.details.open || one.values.childElementCount === 0) {
      one.values.replaceChildren(
        ...node.values.flatMap(([key, value]) => {
          const term = element('dt');
          const definition = element('dd');
          term.textContent = key;
          definition.textContent = value || '–';
          return [term, definition];
        }),
      );
    }
  }

  make(name) {
    const one = {
      item: element('li', 'node'),
      details: element('details'),
      level: element('b'),
      name: element('span', 'name'),
      text: element('span', 'text'),
      rates: element('span', 'rates'),
      values: element('dl'),
    };
    const summary = element('summary');
    one.name.textContent = name;
    summary.append(one.name, one.level, one.text, one.rates);
    one.details.append(summary, one.values);
    one.item.append(one.details);
    this.shown.set(name, one);
    return one;
  }
}
