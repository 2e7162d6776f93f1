// The cycles of a tray that are over: a list, and one of them opened again.

import { interval, known, restitution } from './words.js';

export const finalText = ([, value, lower, upper]) =>
  known(value) ? `${restitution(value)} ${interval(lower, upper, restitution)}` : 'no estimate';

export class Cycles {
  /** `changed` is called when another cycle is shown. */
  constructor(box, list, changed) {
    Object.assign(this, { box, list, changed });
    this.opened = null;
    this.failed = null;
    this.shown = '';
  }

  close() {
    this.opened = null;
    this.failed = null;
  }

  /** Ask for a cycle that is over; the running one is told anyway. */
  async open(tray, cycle) {
    this.failed = null;
    const answer = await fetch(`cycles/${tray}/${cycle}`).catch(() => null);
    if (answer?.ok) {
      const past = await answer.json();
      this.opened = { tray, past };
    } else {
      this.failed = cycle;
    }
    this.shown = '';
    this.changed();
  }

  /** The tray as it was in the cycle that is opened, or as it is. */
  viewOf(number, tray) {
    if (this.opened?.tray !== number) return tray;
    const { past } = this.opened;
    return { ...tray, ...past, opened: true };
  }

  draw(number, tray) {
    const opened = this.opened?.tray === number ? this.opened.past.cycle : null;
    const kept = new Set(tray.past);
    const finals = new Map(tray.finals.map((final) => [final[0], final]));
    const over = [...new Set([...kept, ...finals.keys()])].sort((a, b) => a - b);
    const { mean_restitution: mean, mean_restitution_error: error } = tray.latest.cor ?? {};
    const average = finals.size > 1 && known(mean) ? `Mean: COR ${restitution(mean)} ±\u00a0${restitution(error)}` : '';
    const state = JSON.stringify([number, opened, this.failed, over, tray.finals, tray.past, tray.cycle, average]);
    this.box.hidden = over.length === 0;
    if (state === this.shown) return;
    this.shown = state;
    const running = () => {
      this.close();
      this.changed();
    };
    const numbers = kept.size > 0 || !over.length ? [...new Set([...over, tray.cycle])] : over;
    const entries = numbers.map((cycle) => {
      const final = finals.get(cycle);
      const now = cycle === tray.cycle;
      const value = final ? `${known(final[1]) ? 'COR ' : ''}${finalText(final)}` : now ? 'now' : 'no estimate';
      const gone = cycle === this.failed ? ', not kept any more' : '';
      const open = now ? kept.size > 0 && running : kept.has(cycle) && (() => this.open(number, cycle));
      return this.entry(`Cycle ${cycle}: ${value}${gone}`, opened === (now ? null : cycle), open);
    });
    if (average) entries.push(this.entry(average, false, null));
    const focused = [...this.list.children].findIndex((item) => item.contains(document.activeElement));
    this.list.replaceChildren(...entries);
    this.list.children[focused]?.querySelector('button')?.focus();
  }

  entry(text, current, open) {
    const item = document.createElement('li');
    const inside = open ? document.createElement('button') : document.createElement('span');
    inside.textContent = text;
    if (open) {
      inside.type = 'button';
      inside.setAttribute('aria-pressed', String(current));
      inside.addEventListener('click', open);
    }
    item.append(inside);
    return item;
  }
}
