// The three curves of a tray.

import { aligned, Chart, colour, column, edge, evenly, extent, line } from './chart.js';
import { known, restitution, roundNumbers, speed } from './words.js';

const MM = 1e3;

/** Speed against time, with the law of Haff as it was fitted. */
export class SpeedChart extends Chart {
  constructor(figure, axis) {
    super(figure, 'no speed yet', axis);
    this.log = false;
  }

  setLog(log) {
    this.log = log;
    this.renew();
  }

  draw(tray) {
    const start = tray.start ?? 0;
    const time = (rows) => rows.map((row) => row[0] - start);
    const rows = tray.rows.speed;
    const positive = (value) => (value > 0 ? MM * value : null);
    const measured = [
      time(rows),
      column(rows, 1, positive),
      column(rows, 2, (error, row) => positive(Math.max(row[1] - error, 0.02 * row[1]))),
      column(rows, 2, (error, row) => positive(row[1] + error)),
    ];
    const times = measured[0];
    const fit = [times, times.map((at) => this.fitted(tray.latest.cor, at))];
    const truth = [time(tray.rows.truth), column(tray.rows.truth, 1, positive)];
    const last = tray.latest.speed;
    const first = rows.find((row) => known(row[1]));
    this.show(
      rows.length > 1 ? aligned([measured, fit, truth]) : null,
      first && last
        ? `Mean speed, ${speed(first[1])} mm/s at first, ${speed(last.mean_projected_speed)} mm/s now`
        : 'Mean speed',
    );
  }

  fitted(cor, at) {
    if (!cor || !known(cor.haff_time) || !known(cor.initial_speed)) return null;
    const since = at - (known(cor.cooling_start) ? cor.cooling_start : 0);
    return since >= 0 ? (MM * cor.initial_speed) / (1 + since / cor.haff_time) : null;
  }

  options() {
    const range = (plot) => {
      const limits = extent(plot, [1, 4], this.span) ?? [0, 1];
      if (this.log) return [limits[0] / 1.3, limits[1] * 1.3];
      return [0, limits[1] * 1.08];
    };
    const read = (data, at) => {
      const value = data[1][at] ?? data[4][at];
      return known(value) ? `${data[0][at].toFixed(1)} s: ${speed(value / MM)} mm/s` : '';
    };
    const common = this.common({ distr: this.log ? 3 : 1, range }, read);
    if (this.log) {
      Object.assign(common.axes[1], {
        splits: (_, __, low, high) => roundNumbers(low, high),
        values: (_, splits) => splits.map(String),
        filter: (_, splits) => splits,
      });
    }
    return {
      ...common,
      series: [
        {},
        line('--measured', { width: 0, points: { show: true, size: 4, width: 0, fill: () => colour('--measured') } }),
        edge,
        edge,
        line('--fit', { width: 2.5 }),
        line('--truth', { width: 1.5, dash: [6, 5] }),
      ],
      bands: [{ series: [3, 2], fill: () => colour('--band') }],
    };
  }
}

/** Both restitutions as they become known. */
export class CorChart extends Chart {
  constructor(figure, axis) {
    super(figure, 'no restitution yet: it needs some seconds of cooling', axis);
  }

  draw(tray) {
    const start = tray.start ?? 0;
    const rows = tray.rows.cor.filter((row) => known(row[1]));
    const truth = tray.latest.truth;
    const times = rows.map((row) => row[0] - start);
    const constant = (value) => times.map(() => (known(value) ? value : null));
    const cor = tray.latest.cor;
    this.show(
      rows.length > 0
        ? [times, ...[1, 2, 3, 4, 5, 6].map((k) => column(rows, k)),
            constant(truth?.restitution), constant(truth?.wall_restitution)]
        : null,
      cor && known(cor.restitution)
        ? `Restitution of beads ${restitution(cor.restitution)}, of walls ${restitution(cor.wall_restitution)}`
        : 'Restitution',
    );
  }

  options() {
    const range = (plot) => {
      const [low, high] = extent(plot, [1, 4, 7, 8], this.span) ?? [0, 1];
      const wide = extent(plot, [2, 3, 5, 6], this.span) ?? [low, high];
      // The first intervals are wide; what follows is what one looks at.
      const room = Math.max(0.03, high - low);
      return [
        Math.max(0, Math.min(low, Math.max(wide[0], low - 1.5 * room)) - 0.01),
        Math.min(1.005, Math.max(high, wide[1]) + 0.01),
      ];
    };
    const read = (data, at) => {
      const show = (k) => restitution(data[k][at]);
      return `${data[0][at].toFixed(1)} s: ${show(1)} [${show(2)}, ${show(3)}]`;
    };
    const values = (_, ticks) => evenly(ticks);
    const common = this.common({ range }, read);
    common.axes[1].values = values;
    const dashed = { width: 1.5, dash: [6, 5] };
    return {
      ...common,
      series: [
        {}, line('--fit', { width: 2.5 }), edge, edge, line('--walls'), edge, edge,
        line('--truth', dashed), line('--truth', dashed),
      ],
      bands: [
        { series: [3, 2], fill: () => colour('--fit-band') },
        { series: [6, 5], fill: () => colour('--walls-band') },
      ],
    };
  }
}

/** How many beads a body has. */
export class ClusterChart extends Chart {
  constructor(figure, axis) {
    super(figure, 'no cluster size yet: it comes two seconds after the pictures', axis);
  }

  draw(tray) {
    const start = tray.start ?? 0;
    const rows = tray.rows.cluster.filter((row) => known(row[1]));
    this.show(
      rows.length > 1
        ? [
            rows.map((row) => row[0] - start),
            column(rows, 1),
            column(rows, 2, (error, row) => Math.max(1, row[1] - error)),
            column(rows, 2, (error, row) => row[1] + error),
          ]
        : null,
      `Cluster size, ${rows.length ? rows[rows.length - 1][1].toFixed(2) : 'not known'} beads per body now`,
    );
  }

  options() {
    const range = (plot) => {
      const [, high] = extent(plot, [1], this.span) ?? [1, 2];
      return [0.9, Math.max(2, high * 1.25)];
    };
    const read = (data, at) =>
      known(data[1][at]) ? `${data[0][at].toFixed(1)} s: ${data[1][at].toFixed(2)} beads` : '';
    return {
      ...this.common({ range }, read),
      series: [{}, line('--measured'), edge, edge],
      bands: [{ series: [3, 2], fill: () => colour('--band') }],
    };
  }
}
