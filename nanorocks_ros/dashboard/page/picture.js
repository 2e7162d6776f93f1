// The picture of the tray that is looked at: the tray with its tracks, and over it what moves.

const LAYERS = ['tray', 'tracks', 'motion'];
const STALE_MS = 3000;

export class Picture {
  constructor(canvas, note) {
    this.canvas = canvas;
    this.note = note;
    this.tray = null;
    this.layers = {};
    this.motion = true;
  }

  /** Look at another tray, or at other layers; the last picture stays until the next comes. */
  look(tray, layers) {
    if (tray !== this.tray) this.layers = {};
    this.tray = tray;
    this.motion = layers.includes('motion');
    for (const name of Object.keys(this.layers)) {
      if (!layers.includes(name)) delete this.layers[name];
    }
    this.draw();
  }

  /** Take a message: the tray, the layer, and the picture. */
  async take(buffer) {
    const [tray, layer] = new Uint8Array(buffer, 0, 2);
    if (tray !== this.tray) return;
    const bitmap = await createImageBitmap(new Blob([new Uint8Array(buffer, 2)]));
    if (tray !== this.tray) return;
    this.layers[LAYERS[layer]]?.bitmap.close();
    this.layers[LAYERS[layer]] = { bitmap, at: performance.now() };
    this.draw();
  }

  fresh(name) {
    const one = this.layers[name];
    return one && performance.now() - one.at < STALE_MS ? one.bitmap : null;
  }

  get base() {
    return this.fresh('tracks') ?? this.fresh('tray');
  }

  draw() {
    const base = this.base ?? this.layers.tracks?.bitmap ?? this.layers.tray?.bitmap;
    this.canvas.hidden = !base;
    this.note.hidden = !!base;
    const shape = !base ? 'none' : base.width > 1.6 * base.height ? 'wide' : '';
    document.getElementById('panels').dataset.shape = shape;
    if (!base) return;
    if (this.canvas.width !== base.width || this.canvas.height !== base.height) {
      this.canvas.width = base.width;
      this.canvas.height = base.height;
    }
    const brush = this.canvas.getContext('2d');
    brush.drawImage(base, 0, 0);
    const moving = this.motion && this.fresh('motion');
    if (moving) {
      brush.drawImage(moving, 0, 0, base.width, base.height);
    }
  }
}
