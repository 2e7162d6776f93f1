// The axis of time that several plots have in common: as long as the data, or what was zoomed to.

const SHORTEST_S = 0.2;
const KEY_STEP = 0.25;
const WHEEL_STEP = 0.0015;

export class TimeAxis {
  constructor() {
    this.plots = new Set();
    this.whole = [0, 1];
    this.part = null;
  }

  get shown() {
    return this.part ?? this.whole;
  }

  /** The times of all data; what is zoomed to stays. */
  cover(low, high) {
    this.whole = [low, Math.max(high, low + 1)];
  }

  /** Show a part, in the limits of the data; the whole where the part is as long. */
  show(low, high) {
    const [first, last] = this.whole;
    const width = Math.max(SHORTEST_S, high - low);
    if (width >= last - first) {
      this.part = null;
    } else {
      const begin = Math.min(Math.max(low, first), last - width);
      this.part = [begin, begin + width];
    }
    this.redraw();
  }

  reset() {
    this.part = null;
    this.redraw();
  }

  /** Zoom by a factor below 1 in, above 1 out; a time keeps its place. */
  zoom(factor, at = (this.shown[0] + this.shown[1]) / 2) {
    const [low, high] = this.shown;
    this.show(at - (at - low) * factor, at + (high - at) * factor);
  }

  /** Move by a share of what is shown. */
  pan(share) {
    const [low, high] = this.shown;
    if (this.part) this.show(low + share * (high - low), high + share * (high - low));
  }

  redraw() {
    for (const chart of this.plots) chart.redraw();
  }
}

/** Let a mouse, a finger or two, and keys zoom and pan the axis of a plot in a box. */
export function listen(box, axis, plotOf) {
  const fingers = new Map();
  const time = (plot, clientX) => plot.posToVal(clientX - plot.over.getBoundingClientRect().left, 'x');
  let dragged = null;

  box.addEventListener('wheel', (event) => {
    const plot = plotOf();
    if (!plot) return;
    if (event.ctrlKey || event.metaKey) {
      event.preventDefault();
      axis.zoom(Math.exp(WHEEL_STEP * event.deltaY), time(plot, event.clientX));
    } else if (axis.part && (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY))) {
      event.preventDefault();
      axis.pan((event.deltaX || event.deltaY) / plot.over.clientWidth);
    }
  }, { passive: false });

  box.addEventListener('dblclick', () => axis.reset());

  box.addEventListener('keydown', (event) => {
    const act = {
      '+': () => axis.zoom(1 / 1.5), '=': () => axis.zoom(1 / 1.5), '-': () => axis.zoom(1.5), Escape: () => axis.reset(),
      PageUp: () => axis.pan(-KEY_STEP), PageDown: () => axis.pan(KEY_STEP),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });

  // A mouse with the shift key, and fingers; the mouse alone marks a part, which uPlot does.
  box.addEventListener('pointerdown', (event) => {
    if (!plotOf()) return;
    if (event.pointerType === 'touch') fingers.set(event.pointerId, event.clientX);
    else if (event.shiftKey) {
      dragged = event.clientX;
      box.setPointerCapture(event.pointerId);
      event.stopPropagation();
    }
  }, { capture: true });
  box.addEventListener('pointermove', (event) => {
    const plot = plotOf();
    if (!plot) return;
    if (dragged !== null) {
      axis.pan((dragged - event.clientX) / plot.over.clientWidth);
      dragged = event.clientX;
    }
    if (!fingers.has(event.pointerId)) return;
    const before = [...fingers.values()];
    fingers.set(event.pointerId, event.clientX);
    const after = [...fingers.values()];
    if (after.length === 1) axis.pan((before[0] - after[0]) / plot.over.clientWidth);
    if (after.length === 2) {
      const [wide, wider] = [before, after].map(([a, b]) => Math.max(16, Math.abs(a - b)));
      axis.zoom(wide / wider, time(plot, (after[0] + after[1]) / 2));
    }
  });
  for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) {
    box.addEventListener(name, (event) => {
      fingers.delete(event.pointerId);
      dragged = null;
    });
  }
  // While the shift key moves, uPlot is not to mark.
  box.addEventListener('mousedown', (event) => event.shiftKey && event.stopPropagation(), { capture: true });
}
