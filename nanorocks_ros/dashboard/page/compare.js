// All trays beside each other: restitutions with their intervals, and speeds on one axis of time.

import { aligned, Chart, colour, column, evenly, extent, line } from './chart.js';
import { interval, known, restitution, roundNumbers, saysSomething, speed } from './words.js';

const MM = 1e3;
const CAP_PX = 5;
const ASIDE = 0.12;
const trayColour = (number) => `--tray-${((number - 1) % 8) + 1}`;

/** The latest restitutions of a tray: of this cycle, or else the last final ones. */
function latestOf(tray) {
  const { cor } = tray.latest;
  if (saysSomething(cor)) {
    const walls = [cor.wall_restitution, cor.wall_restitution_lower, cor.wall_restitution_upper];
    return [tray.cycle, cor.restitution, cor.restitution_lower, cor.restitution_upper, ...walls];
  }
  const last = tray.finals[tray.finals.length - 1];
  return last && known(last[1]) ? [...last, null, null, null] : null;
}

const sorted = (trays) => [...trays].sort(([a], [b]) => a - b);

/** Restitutions of beads and walls of every tray, with their intervals. */
export class CorComparison extends Chart {
  constructor(figure) {
    super(figure, 'no restitution of any tray yet', null);
    this.numbers = [];
  }

  get span() {
    return [0.4, this.numbers.length + 0.6];
  }

  draw(trays) {
    const all = sorted(trays);
    this.numbers = all.map(([number]) => number);
    this.rows = all.map(([number, tray]) => [number, ...(latestOf(tray) ?? Array(7).fill(null))]);
    const places = this.rows.flatMap((_, k) => [k + 1 - ASIDE, k + 1 + ASIDE]);
    const beads = this.rows.flatMap((row) => [row[2], null]);
    const walls = this.rows.flatMap((row) => [null, row[5]]);
    const some = this.rows.some((row) => known(row[2]));
    const told = this.rows.filter((row) => known(row[2])).map((row) => `tray ${row[0]} ${restitution(row[2])}`);
    this.show(some ? [places, beads, walls] : null, `Restitution of beads: ${told.join(', ')}`);
  }

  /** Lines from the lower to the upper ends. */
  drawIntervals(plot) {
    const brush = plot.ctx;
    const scale = devicePixelRatio || 1;
    brush.save();
    brush.lineWidth = 2 * scale;
    for (const [first, aside, name] of [[2, -ASIDE, '--fit'], [5, ASIDE, '--walls']]) {
      brush.strokeStyle = colour(name);
      this.rows.forEach((row, k) => {
        if (!known(row[first + 1]) || !known(row[first + 2])) return;
        const x = plot.valToPos(k + 1 + aside, 'x', true);
        const [low, high] = [row[first + 1], row[first + 2]].map((value) => plot.valToPos(value, 'y', true));
        brush.beginPath();
        brush.moveTo(x, low);
        brush.lineTo(x, high);
        for (const y of [low, high]) {
          brush.moveTo(x - CAP_PX * scale, y);
          brush.lineTo(x + CAP_PX * scale, y);
        }
        brush.stroke();
      });
    }
    brush.restore();
  }

  options() {
    const range = () => {
      const values = this.rows.flatMap((row) => row.slice(2)).filter(known);
      return values.length ? [Math.max(0, Math.min(...values) - 0.02), Math.min(1.02, Math.max(...values) + 0.02)] : [0, 1];
    };
    const read = (_, at) => {
      const row = this.rows[Math.floor(at / 2)];
      return row && known(row[2]) ? `tray ${row[0]}, cycle ${row[1]}: ${restitution(row[2])} ${interval(row[3], row[4], restitution)}` : '';
    };
    const common = this.common({ range }, read);
    const [x, y] = common.axes;
    x.splits = () => this.numbers.map((_, k) => k + 1);
    x.values = () => this.numbers.map(String);
    x.grid = { show: false };
    y.values = (_, ticks) => evenly(ticks);
    const dots = (name) => line(name, { width: 0, points: { show: true, size: 8, width: 0, fill: () => colour(name) } });
    return {
      ...common,
      hooks: { ...common.hooks, draw: [(plot) => this.drawIntervals(plot)] },
      series: [{}, dots('--fit'), dots('--walls')],
    };
  }

  table() {
    const cor = ['restitution', 'restitution_lower', 'restitution_upper'];
    const names = ['tray', 'cycle', ...cor, ...cor.map((name) => `wall_${name}`)];
    return [names, this.rows.filter((row) => known(row[2]))];
  }
}

/** Mean speeds of all trays, each since its shaking event. */
export class SpeedComparison extends Chart {
  constructor(figure, axis) {
    super(figure, 'no speed of any tray yet', axis);
    this.key = figure.querySelector('.trays');
    this.numbers = [];
  }

  draw(trays) {
    const all = sorted(trays).filter(([, tray]) => tray.rows.speed.length > 1);
    const numbers = all.map(([number]) => number);
    if (String(numbers) !== String(this.numbers)) {
      this.numbers = numbers;
      this.forget();
      this.key.replaceChildren(...numbers.map((number) => {
        const item = document.createElement('span');
        item.className = `tray-key tray-${((number - 1) % 8) + 1}`;
        item.textContent = `tray ${number}`;
        return item;
      }));
    }
    const since = ([, tray]) => tray.rows.speed.map((row) => row[0] - (tray.start ?? tray.rows.speed[0][0]));
    const curves = all.map((entry) => [since(entry), column(entry[1].rows.speed, 1, (value) => (value > 0 ? MM * value : null))]);
    const ends = curves.map(([times]) => [times[0], times[times.length - 1]]);
    if (curves.length) this.axis.cover(Math.min(0, ...ends.map(([low]) => low)), Math.max(...ends.map(([, high]) => high)));
    this.rows = all.flatMap(([number, tray]) =>
      tray.rows.speed.map((row) => [number, tray.cycle, row[0] - (tray.start ?? tray.rows.speed[0][0]), row[1], row[2]]));
    this.show(curves.length ? aligned(curves) : null, `Mean speeds of trays ${numbers.join(', ')}`);
  }

  options() {
    const columns = this.numbers.map((_, k) => k + 1);
    const range = (plot) => {
      const [low, high] = extent(plot, columns, this.span) ?? [1, 10];
      return [low / 1.2, high * 1.2];
    };
    const read = (data, at) => {
      const told = this.numbers.map((number, k) => (known(data[k + 1][at]) ? `${number}: ${speed(data[k + 1][at] / MM)}` : ''));
      return `${data[0][at].toFixed(1)} s, tray ${told.filter(Boolean).join(', ')}`;
    };
    const common = this.common({ distr: 3, range }, read);
    Object.assign(common.axes[1], {
      splits: (_, __, low, high) => roundNumbers(low, high),
      values: (_, splits) => splits.map(String),
      filter: (_, splits) => splits,
    });
    return { ...common, series: [{}, ...this.numbers.map((number) => line(trayColour(number), { width: 1.75 }))] };
  }

  table() {
    const names = ['tray', 'cycle', 'time_since_shake', 'mean_projected_speed', 'mean_projected_speed_error'];
    const [low, high] = this.span;
    return [names, this.rows.filter((row) => row[2] >= low && row[2] <= high)];
  }
}
