// A film described in the browser: corners, a bead of each species, sizes; and what is recognised.

import { boxAround, Marks, RINGS } from './marks.js';
import { numberIn, SpeciesForm } from './species.js';

const PAUSE_MS = 300;
const MOST_THUMBNAILS = 8;
const FINEST_PX = 1600;
const CLICK = 'Click the four corners of the container, on the inside, one after the other.';
const DRAG =
  'Drag the corners to the inside of the container, and the circle over one bead of each species; drag its edge to the size of the bead.';

const at = (id) => document.getElementById(id);
const film = await (await fetch('film')).json();
const images = new Map();
const species = [{ bead: null, marked: false }];
const marks = new Marks(film.width, film.height, changed);
const forms = new SpeciesForm(at('species'), species, changed);
const shownFrames = [...new Set(Array.from({ length: MOST_THUMBNAILS }, (_, k) =>
  Math.round((k * (film.frames - 1)) / (MOST_THUMBNAILS - 1))))];

let frame = 0;
let result = null;
let asking = false;
let due = null;

at('namespace').textContent = film.name;
// Lines over a small film are finer than its pixels.
const finer = Math.max(1, FINEST_PX / film.width);
at('picture').width = Math.round(finer * film.width);
at('picture').height = Math.round(finer * film.height);

const read = (input) => numberIn(input.value);

function formNow() {
  const marked = species.filter((kind) => kind.marked);
  return {
    corners: marks.told(),
    sides_mm: [read(at('length')), read(at('width'))],
    height_mm: read(at('height')),
    species: marked.map(({ bead, told }) => ({ bead, ...told })),
  };
}

/** Something else is told: recognise again, once nothing changes any more. */
function changed() {
  at('save').disabled = true;
  const box = boxAround(marks.corners);
  ['left', 'top', 'right', 'bottom'].forEach((id, k) => {
    if (document.activeElement !== at(id)) at(id).value = box[k];
  });
  at('click-corners').setAttribute('aria-pressed', String(!!marks.clicking));
  at('hint').textContent = marks.clicking ? CLICK : DRAG;
  forms.draw();
  draw();
  clearTimeout(due);
  due = setTimeout(recognise, PAUSE_MS);
}

async function ask(path) {
  const headers = { 'Content-Type': 'application/json' };
  const answer = await fetch(path, { method: 'POST', headers, body: JSON.stringify(formNow()) }).catch(() => null);
  if (!answer) return { error: 'the command has ended' };
  return answer.json().catch(() => ({ error: `the server answers ${answer.status}` }));
}

function say(state, text) {
  at('link').dataset.state = state;
  at('link').textContent = text;
}

async function recognise() {
  if (asking) {
    // One at a time; the answer asks again.
    due = setTimeout(recognise, PAUSE_MS);
    return;
  }
  asking = true;
  say('waiting', 'recognising');
  const asked = JSON.stringify(formNow());
  const answer = await ask('recognise');
  asking = false;
  if (asked !== JSON.stringify(formNow())) return;
  showAnswer(answer);
}

function showAnswer(answer) {
  result = answer.error ? null : answer;
  at('error').hidden = !answer.error;
  at('error').textContent = answer.error ?? '';
  at('save').disabled = !!answer.error;
  say(answer.error ? 'error' : 'ok', answer.error ? 'not usable as described' : 'recognised');
  if (result && !species[0].marked && result.beads.length) {
    species[0].bead = result.beads[0].map((value) => Math.round(10 * value) / 10);
  }
  for (const kind of species) kind.bead ??= [film.width / 2, film.height / 2, film.width / 20];
  fill('verdicts', (result?.verdicts ?? []).map(verdictItem));
  fill('notices', (result?.notices ?? []).map((text) => element('li', text)));
  at('text').textContent = result?.text ?? '';
  forms.draw();
  draw();
}

function element(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

const fill = (id, items) => at(id).replaceChildren(...items);

function verdictItem({ usable, lines, numbers }) {
  const item = element('li', '');
  item.dataset.state = usable ? 'ok' : 'warning';
  const share = numbers.map(([number, frames]) => `${number} in ${frames}`).join(', ');
  item.append(...lines.map((line) => element('p', line)), element('p', `found in frames: ${share}`));
  return item;
}

function drawDiscs(brush, number, scale) {
  if (!result || at('discs').getAttribute('aria-pressed') !== 'true') return;
  brush.lineWidth = 2 * scale;
  result.discs[number].forEach((discs, k) => {
    brush.strokeStyle = RINGS[k];
    for (const [x, y, radius] of discs) {
      brush.beginPath();
      brush.arc(x, y, radius, 0, 2 * Math.PI);
      brush.stroke();
    }
  });
}

function draw() {
  const canvas = at('picture');
  const brush = canvas.getContext('2d');
  const scale = film.width / (canvas.clientWidth || film.width);
  brush.setTransform(finer, 0, 0, finer, 0, 0);
  if (images.has(frame)) brush.drawImage(images.get(frame), 0, 0);
  drawDiscs(brush, frame, scale);
  marks.draw(brush, species, scale, frame === 0);
  at('frame-title').textContent = frame === 0 ? 'First frame' : `Frame ${frame + 1} of ${film.frames} that are looked at`;
  [...at('frames').querySelectorAll('button')].forEach((button, k) => drawThumbnail(button, shownFrames[k]));
}

function drawThumbnail(button, number) {
  const canvas = button.querySelector('canvas');
  const brush = canvas.getContext('2d');
  const share = canvas.width / film.width;
  brush.setTransform(share, 0, 0, share, 0, 0);
  if (images.has(number)) brush.drawImage(images.get(number), 0, 0);
  drawDiscs(brush, number, 1.3 / share);
  brush.setTransform(1, 0, 0, 1, 0, 0);
  const counts = result ? result.discs[number].map((discs) => discs.length).join(' + ') : '–';
  button.querySelector('span').textContent = `${counts} found`;
  button.setAttribute('aria-current', String(number === frame));
}

function addThumbnail(number) {
  const item = document.createElement('li');
  const button = document.createElement('button');
  const canvas = document.createElement('canvas');
  button.type = 'button';
  canvas.width = 480;
  canvas.height = Math.max(1, Math.round((480 * film.height) / film.width));
  button.append(canvas, document.createElement('span'));
  button.setAttribute('aria-label', `Frame ${number + 1}`);
  button.addEventListener('click', () => {
    frame = number;
    draw();
  });
  item.append(button);
  at('frames').append(item);
}

const place = (event) => {
  const box = at('picture').getBoundingClientRect();
  return [((event.clientX - box.left) * film.width) / box.width, ((event.clientY - box.top) * film.height) / box.height];
};

at('picture').addEventListener('pointerdown', (event) => {
  const reach = film.width / at('picture').clientWidth;
  if (marks.click(place(event))) {
    draw();
    return;
  }
  marks.held = marks.under(place(event), species, reach, frame === 0);
  if (marks.held) at('picture').setPointerCapture(event.pointerId);
});
at('picture').addEventListener('pointermove', (event) => {
  if (!marks.held) return;
  marks.drag(place(event), species);
  changed();
});
for (const name of ['pointerup', 'pointercancel']) {
  at('picture').addEventListener(name, () => {
    marks.held = null;
  });
}
at('click-corners').addEventListener('click', () => {
  marks.clicking = marks.clicking ? null : [];
  changed();
});
at('no-corners').addEventListener('click', () => {
  marks.wholePicture();
  changed();
});
at('discs').addEventListener('click', () => {
  at('discs').setAttribute('aria-pressed', String(at('discs').getAttribute('aria-pressed') !== 'true'));
  draw();
});
for (const id of ['left', 'top', 'right', 'bottom']) {
  at(id).addEventListener('change', () => {
    const box = ['left', 'top', 'right', 'bottom'].map((side) => read(at(side)));
    if (box.every((value) => typeof value === 'number')) marks.setBox(box);
    changed();
  });
}
for (const id of ['length', 'width', 'height']) at(id).addEventListener('input', changed);
at('add').addEventListener('click', () => {
  if (species.length < RINGS.length) {
    species.push({ bead: [film.width / 2, film.height / 2, species[0].bead?.[2] ?? film.width / 20], marked: false });
  }
  changed();
});
at('form').addEventListener('submit', async (event) => {
  event.preventDefault();
  at('save').disabled = true;
  say('waiting', 'saving');
  const answer = await ask('save');
  if (answer.error) {
    showAnswer(answer);
    return;
  }
  say('ok', 'saved');
  at('saved').hidden = false;
  at('saved').textContent = `Saved in ${answer.saved}. The terminal names the next command; this page can be closed.`;
});
window.addEventListener('resize', draw);

shownFrames.forEach(addThumbnail);
for (const number of shownFrames) {
  const image = new Image();
  image.src = `frames/${number}`;
  image.decode().then(() => {
    images.set(number, image);
    draw();
  }).catch(() => say('error', 'a frame cannot be loaded'));
}
changed();
