// A plot, drawn by uPlot: its colours, axes and empty state.

import { listen } from './time_axis.js';
import { known } from './words.js';

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Rows of different curves on one axis of time: one column each, null where a curve has no point. */
export function aligned(curves) {
  const full = curves.filter((curve) => curve.length > 0 && curve[0].length > 0);
  if (full.length === 0) return null;
  const data = uPlot.join(full);
  const columns = [data[0]];
  let next = 1;
  for (const curve of curves) {
    const has = curve.length > 0 && curve[0].length > 0;
    for (let k = 1; k < curve.length; k += 1) {
      columns.push(has ? data[next++] : data[0].map(() => null));
    }
  }
  return columns;
}

export const column = (rows, index, change = (value) => value) =>
  rows.map((row) => (known(row[index]) ? change(row[index], row) : null));

// A line of one point would not be seen.
const few = (plot) => plot.data[0].length < 4;

export const line = (name, more = {}) => ({
  stroke: () => colour(name),
  width: 2,
  spanGaps: true,
  points: { show: few, size: 6, fill: () => colour(name) },
  ...more,
});

export const edge = { stroke: 'transparent', width: 0, spanGaps: true, points: { show: false } };

/** The largest and smallest number of some columns, where they are seen. */
export function extent(plot, columns, [min, max]) {
  let low = Infinity;
  let high = -Infinity;
  plot.data[0].forEach((at, k) => {
    if (at < min || at > max) return;
    for (const index of columns) {
      const value = plot.data[index][k];
      if (known(value)) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
  });
  return low <= high ? [low, high] : null;
}

/** Numbers at equal distances, all with the digits that the distance has. */
export function evenly(ticks) {
  const step = ticks.length > 1 ? ticks[1] - ticks[0] : 1;
  const digits = [0, 1, 2].find((some) => Math.abs(step * 10 ** some - Math.round(step * 10 ** some)) < 1e-6) ?? 3;
  return ticks.map((tick) => tick.toFixed(digits));
}

const seconds = (ticks) => evenly(ticks).map((tick, k) => (k === ticks.length - 1 ? `${tick} s` : tick));

/** A figure with a curve in it, its text for those who do not see it, and its empty state. */
export class Chart {
  /** `axis` is the axis of time that it shares with others; none: `this.span` is shown. */
  constructor(figure, awaited, axis) {
    this.box = figure.querySelector('.plot');
    this.output = figure.querySelector('output');
    this.axis = axis;
    this.note = document.createElement('p');
    this.note.className = 'awaited';
    this.note.textContent = awaited;
    this.box.append(this.note);
    this.plot = null;
    this.data = null;
    this.exporters = [];
    if (axis) {
      this.box.tabIndex = 0;
      axis.plots.add(this);
      listen(this.box, axis, () => this.plot);
    }
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(this.box);
  }

  size() {
    return { width: Math.max(160, this.box.clientWidth), height: Math.max(120, this.box.clientHeight) };
  }

  get span() {
    return this.axis.shown;
  }

  /** Show the part of the axis that is wanted now. */
  redraw() {
    this.plot?.setData(this.data);
  }

  /** Draw; `data` is null when there is nothing to draw yet. */
  show(data, label) {
    this.data = data;
    this.note.hidden = data !== null;
    for (const button of this.exporters) button.disabled = data === null;
    this.box.setAttribute('aria-label', data ? label : this.note.textContent);
    if (!data) {
      this.forget();
      return;
    }
    if (this.plot) {
      this.plot.setData(data);
      return;
    }
    this.plot = new uPlot({ ...this.options(), ...this.size() }, data, this.box);
  }

  /** Draw afresh, in other colours or on another scale. */
  renew() {
    this.forget();
    if (this.data) {
      this.plot = new uPlot({ ...this.options(), ...this.size() }, this.data, this.box);
    }
  }

  forget() {
    this.plot?.destroy();
    this.plot = null;
    this.output.textContent = '';
  }

  common(y, read) {
    const axis = {
      stroke: () => colour('--muted'),
      font: '12px system-ui, sans-serif',
      grid: { stroke: () => colour('--grid'), width: 1 },
      ticks: { show: false },
    };
    return {
      legend: { show: false },
      padding: [10, 20, 0, 0],
      cursor: {
        y: false,
        drag: { x: !!this.axis, y: false, setScale: false },
        points: { size: 7, fill: () => colour('--panel') },
      },
      scales: { x: { time: false, range: () => this.span }, y },
      axes: [
        { ...axis, size: 30, values: (_, ticks) => seconds(ticks) },
        { ...axis, size: 52 },
      ],
      hooks: {
        setCursor: [
          (plot) => {
            const at = plot.cursor.idx;
            this.output.textContent = known(at) ? read(plot.data, at) : '';
          },
        ],
        setSelect: [
          (plot) => {
            const { left, width } = plot.select;
            if (width < 4) return;
            plot.setSelect({ left: 0, width: 0 }, false);
            this.axis.show(plot.posToVal(left, 'x'), plot.posToVal(left + width, 'x'));
          },
        ],
      },
    };
  }
}
