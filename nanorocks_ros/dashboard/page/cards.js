// All trays at a glance.

import { flags, interval, known, restitution, saysSomething, speed, trayState } from './words.js';

const SVG = 'http://www.w3.org/2000/svg';
const POINTS = 60;

/** A curve of speeds in a box of 100 by 24. */
function spark(rows) {
  const seen = rows.filter((row) => known(row[1]));
  if (seen.length < 2) return '';
  const step = Math.max(1, Math.floor(seen.length / POINTS));
  const some = seen.filter((_, index) => index % step === 0 || index === seen.length - 1);
  const [begin, end] = [some[0][0], some[some.length - 1][0]];
  const most = Math.max(...some.map((row) => row[1])) || 1;
  return some
    .map((row) => `${((100 * (row[0] - begin)) / (end - begin || 1)).toFixed(1)},${(22.5 - (21 * row[1]) / most).toFixed(1)}`)
    .join(' ');
}

export class Cards {
  constructor(bar, choose) {
    this.bar = bar;
    this.choose = choose;
    this.shown = new Map();
  }

  draw(trays, chosen, silentFor) {
    // One tray alone is seen below.
    this.bar.hidden = trays.size < 2;
    for (const number of [...this.shown.keys()]) {
      if (!trays.has(number)) {
        this.shown.get(number).card.remove();
        this.shown.delete(number);
      }
    }
    [...trays.keys()].sort((a, b) => a - b).forEach((number, index) => {
      const one = this.shown.get(number) ?? this.make(number);
      if (this.bar.children[index] !== one.card) this.bar.insertBefore(one.card, this.bar.children[index] ?? null);
      this.drawOne(one, number, trays.get(number), silentFor(trays.get(number)));
      one.card.setAttribute('aria-current', String(number === chosen));
    });
  }

  drawOne(one, number, tray, silent) {
    const [state, words, few] = trayState(tray, silent);
    const [flag] = flags(tray.latest);
    one.state.dataset.state = flag && state === 'ok' ? 'warning' : state;
    one.state.textContent = flag ?? few;
    const cor = tray.latest.cor;
    const now = tray.latest.speed?.mean_projected_speed;
    const last = tray.finals[tray.finals.length - 1];
    if (saysSomething(cor)) {
      one.value.firstChild.textContent = `${restitution(cor.restitution)} `;
      one.small.textContent = `${interval(cor.restitution_lower, cor.restitution_upper, restitution)}`;
    } else if (last && known(last[1])) {
      one.value.firstChild.textContent = `${restitution(last[1])} `;
      one.small.textContent = `in cycle ${last[0]}`;
    } else {
      one.value.firstChild.textContent = known(now) ? `${speed(now)} ` : '– ';
      one.small.textContent = known(now) ? 'mm/s' : 'no COR yet';
    }
    one.line.setAttribute('points', spark(tray.rows.speed));
    one.card.setAttribute('aria-label', `Tray ${number}, ${words}, ${one.value.textContent}`);
  }

  make(number) {
    const card = document.createElement('button');
    const [name, state, value, small] = ['span', 'span', 'span', 'small'].map((tag) => document.createElement(tag));
    const svg = document.createElementNS(SVG, 'svg');
    const line = document.createElementNS(SVG, 'polyline');
    card.type = 'button';
    card.className = 'card';
    name.className = 'name';
    state.className = 'state';
    value.className = 'value';
    name.textContent = `Tray ${number}`;
    value.append('', small);
    value.prepend(document.createTextNode(''));
    svg.setAttribute('viewBox', '0 0 100 24');
    svg.setAttribute('preserveAspectRatio', 'none');
    svg.setAttribute('aria-hidden', 'true');
    svg.append(line);
    card.append(name, state, value, svg);
    card.addEventListener('click', () => this.choose(number));
    card.setAttribute('aria-keyshortcuts', String(number));
    const one = { card, state, value, small, line };
    this.bar.append(card);
    this.shown.set(number, one);
    return one;
  }
}
