// The numbers of a tray, each with what is to be said of it.

import * as words from './words.js';
import { finalText } from './cycles.js';

const at = (id) => document.getElementById(id);

/** A number with what is to be said of it below; or only that, while there is no number. */
function number(id, value, small) {
  const shown = at(id);
  const note = document.createElement('small');
  note.textContent = small;
  shown.classList.toggle('awaited-value', !value);
  shown.replaceChildren(...(value ? [value, note] : [small]));
}

export function drawNumbers(tray) {
  const { cor, cluster, speed } = tray.latest;
  drawCor(tray);
  const wall = words.saysSomething(cor) && words.known(cor.wall_restitution);
  number(
    'walls',
    wall && words.restitution(cor.wall_restitution),
    wall ? words.interval(cor.wall_restitution_lower, cor.wall_restitution_upper, words.restitution) : 'not known yet',
  );
  number(
    'speed',
    speed && `${words.speed(speed.mean_projected_speed)} mm/s`,
    speed ? `${words.give(speed.mean_projected_speed_error, words.speed)} by ${speed.method.replaceAll('_', ' ')}` : 'no speed yet',
  );
  const fitted = cor && words.known(cor.haff_time);
  number('haff', fitted && `${cor.haff_time.toFixed(2)} s`, fitted ? words.give(cor.haff_time_error, (one) => one.toFixed(2), ' s') || 'of the fit' : 'no fit yet');
  const size = cluster && words.known(cluster.combined_size);
  number(
    'cluster',
    size && cluster.combined_size.toFixed(2),
    size ? `beads per body ${words.give(cluster.combined_size_error, (one) => one.toFixed(2))}` : 'not known yet',
  );
  number('sticking', ...(cluster ? words.sticking(cluster) : ['', 'not known yet']));
  number('drag', ...words.drag(cor));
  number('acceleration', ...words.acceleration(cor));
  number('exponent', ...words.exponent(cor));
}

function drawCor({ latest: { cor }, start, finals }) {
  if (!words.saysSomething(cor)) {
    const last = finals[finals.length - 1];
    const before = last && words.known(last[1]) ? `; cycle ${last[0]}: ${finalText(last)}` : '';
    const awaited = start === null ? 'no shaking event yet' : 'no estimate yet';
    number('cor', '', (cor ? words.corState(cor) : awaited) + before);
    return;
  }
  const shown = at('cor');
  const bounds = document.createElement('span');
  bounds.className = 'interval';
  bounds.textContent = words.interval(cor.restitution_lower, cor.restitution_upper, words.restitution);
  const note = document.createElement('small');
  const contacts = cor.rebounds + cor.collisions;
  note.textContent = words.corState(cor) + words.source(cor, contacts);
  shown.classList.remove('awaited-value');
  shown.replaceChildren(`${words.restitution(cor.restitution)} `, bounds, note);
}
