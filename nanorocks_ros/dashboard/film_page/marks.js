// What is marked in a frame: the corners of the container and a circle over a bead of each species.

export const RINGS = ['#22c55e', '#f97316', '#c084fc', '#06b6d4', '#eab308', '#ec4899'];
const REACH_PX = 16;
const EDGE_PX = 9;
const SMALLEST = 3;

/** The corners of the box around some points, from the upper left one on. */
export function boxAround(points) {
  const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

const cornersOf = ([left, top, right, bottom]) => [[left, top], [right, top], [right, bottom], [left, bottom]];
const distance = ([a, b], [x, y]) => Math.hypot(a - x, b - y);

export class Marks {
  /** `changed` is called when somebody has marked something else. */
  constructor(width, height, changed) {
    Object.assign(this, { width, height, changed });
    this.corners = cornersOf([0, 0, width, height]);
    this.cornersTold = false;
    this.clicking = null;
    this.clicked = null;
    this.held = null;
  }

  setBox(box) {
    this.corners = cornersOf(box);
    this.cornersTold = true;
    this.clicked = null;
  }

  /** All four corners of a container that may be seen at an angle. */
  setCorners(corners) {
    this.setBox(boxAround(corners));
    this.clicked = corners;
  }

  /** The corners that are drawn, and can be dragged. */
  get shown() {
    return this.clicked ?? this.corners;
  }

  /** What is told of the corners: all four as they were clicked or dragged, until a side of the box is told. */
  told() {
    if (!this.cornersTold) return [];
    return this.clicked ? this.clicked.flat() : boxAround(this.corners);
  }

  wholePicture() {
    this.corners = cornersOf([0, 0, this.width, this.height]);
    this.cornersTold = false;
    this.clicking = null;
    this.clicked = null;
  }

  /** What is under a pointer; `reach` is a pixel of the screen in pixels of the film. */
  under(place, species, reach, beads) {
    for (const [k, corner] of this.shown.entries()) {
      if (distance(corner, place) < REACH_PX * reach) return { corner: k };
    }
    if (!beads) return null;
    for (const [k, { bead }] of species.entries()) {
      if (!bead) continue;
      const off = distance(bead, place);
      if (Math.abs(off - bead[2] / 2) < EDGE_PX * reach && off > bead[2] / 4) return { edge: k };
      if (off < bead[2] / 2) return { circle: k, from: [place[0] - bead[0], place[1] - bead[1]] };
    }
    return null;
  }

  /** A click where a corner is awaited; whether it was taken. */
  click(place) {
    if (!this.clicking) return false;
    this.clicking.push(place.map((value) => Math.round(value)));
    if (this.clicking.length === 4) {
      this.setCorners(this.clicking);
      this.clicking = null;
      this.changed();
    }
    return true;
  }

  drag(place, species) {
    const { corner, edge, circle, from } = this.held;
    const inside = [Math.min(Math.max(place[0], 0), this.width), Math.min(Math.max(place[1], 0), this.height)];
    if (corner !== undefined && this.clicked) {
      this.setCorners(this.clicked.with(corner, inside.map((value) => Math.round(value))));
    } else if (corner !== undefined) {
      // The container is upright in the picture: the corner opposite stays, the others follow.
      const moved = inside.map((value) => Math.round(value));
      const opposite = this.corners[(corner + 2) % 4];
      this.setBox(boxAround([moved, opposite]));
      this.held.corner = this.corners.findIndex(([x, y]) => x === moved[0] && y === moved[1]);
    } else if (edge !== undefined) {
      const { bead } = species[edge];
      bead[2] = Math.max(SMALLEST, Math.round(20 * distance(bead, place)) / 10);
      species[edge].marked = true;
    } else {
      const { bead } = species[circle];
      bead[0] = Math.round(10 * Math.min(Math.max(inside[0] - from[0], 0), this.width - 1)) / 10;
      bead[1] = Math.round(10 * Math.min(Math.max(inside[1] - from[1], 0), this.height - 1)) / 10;
      species[circle].marked = true;
    }
  }

  draw(brush, species, scale, beads) {
    brush.lineWidth = 2 * scale;
    brush.strokeStyle = '#ffc800';
    brush.fillStyle = '#ffc800';
    brush.setLineDash(this.cornersTold ? [] : [6 * scale, 5 * scale]);
    const outline = this.shown;
    brush.beginPath();
    for (const [x, y] of outline) brush.lineTo(x, y);
    brush.closePath();
    brush.stroke();
    brush.setLineDash([]);
    for (const [x, y] of this.clicking ?? outline) {
      brush.beginPath();
      brush.arc(x, y, 6 * scale, 0, 2 * Math.PI);
      brush.fill();
    }
    if (!beads) return;
    species.forEach(({ bead }, k) => {
      if (!bead) return;
      for (const [colour, width] of [['#000000', 6], [RINGS[k], 3.5]]) {
        brush.strokeStyle = colour;
        brush.lineWidth = width * scale;
        brush.beginPath();
        brush.arc(bead[0], bead[1], bead[2] / 2, 0, 2 * Math.PI);
        brush.stroke();
      }
    });
  }
}
