// The fields of each species: its bead in the picture, its name, size and number.

const FIELDS = [
  ['material', 'Material or name', '', 'name'],
  ['diameter_mm', 'Diameter', 'mm', 'number'],
  ['count', 'Number of beads', '', 'number'],
  ['density_g_cm3', 'Density', 'g/cm³', 'number'],
];
const PLACE = ['column', 'row', 'diameter'];

/** A number as it is written; what is none is sent as text, and refused in words. */
export function numberIn(text) {
  const plain = text.trim().replace(',', '.');
  return plain === '' ? null : Number.isFinite(Number(plain)) ? Number(plain) : plain;
}

export class SpeciesForm {
  constructor(box, species, changed) {
    Object.assign(this, { box, species, changed });
  }

  draw() {
    while (this.box.children.length > this.species.length) this.box.lastChild.remove();
    this.species.forEach((kind, k) => {
      if (!this.box.children[k]) this.box.append(this.make(k));
      const set = this.box.children[k];
      set.querySelector('.mark-me').hidden = kind.marked || k === 0;
      set.querySelector('.remove').hidden = this.species.length < 2;
      [...set.querySelectorAll('.four input')].forEach((input, axis) => {
        if (document.activeElement !== input) input.value = kind.bead ? Math.round(10 * kind.bead[axis]) / 10 : '';
      });
    });
  }

  make(k) {
    const set = document.createElement('fieldset');
    const legend = document.createElement('legend');
    const ring = document.createElement('span');
    ring.className = `swatch-ring ring-${k + 1}`;
    legend.append(ring, `Species ${k + 1}`);
    const note = document.createElement('p');
    note.className = 'mark-me';
    note.textContent = 'Drag its circle, now in the middle of the first frame, over a bead.';
    const place = document.createElement('div');
    place.className = 'four';
    place.append(...PLACE.map((name, axis) => this.placeField(k, name, axis)));
    const remove = document.createElement('button');
    remove.type = 'button';
    remove.className = 'remove';
    remove.textContent = 'Remove';
    remove.addEventListener('click', () => {
      this.species.splice(k, 1);
      // The fields of those behind it are theirs.
      this.box.replaceChildren();
      this.changed();
    });
    set.append(legend, note, ...FIELDS.map((field) => this.field(k, ...field)), place, remove);
    return set;
  }

  field(k, key, text, unit, kind) {
    const label = document.createElement('label');
    const input = document.createElement('input');
    const side = document.createElement('span');
    input.className = kind;
    input.dataset.field = key;
    input.inputMode = kind === 'name' ? 'text' : 'decimal';
    input.value = this.species[k].told?.[key] ?? '';
    input.addEventListener('input', () => {
      const species = this.species[k];
      species.told = { ...species.told, [key]: kind === 'name' ? input.value.trim() : numberIn(input.value) };
      // What is told of beads needs one of them.
      species.marked ||= species.bead !== null && k === 0;
      this.changed();
    });
    const of = document.createElement('i');
    of.textContent = unit;
    side.append(input, of);
    label.append(text, side);
    return label;
  }

  placeField(k, name, axis) {
    const label = document.createElement('label');
    const input = document.createElement('input');
    input.inputMode = 'decimal';
    input.addEventListener('change', () => {
      const value = numberIn(input.value);
      const species = this.species[k];
      if (typeof value === 'number' && species.bead) {
        species.bead[axis] = value;
        species.marked = true;
      }
      this.changed();
    });
    label.append(`${name}, px`, input);
    return label;
  }
}
