// Numbers and states as people read them.

export const known = (value) => typeof value === 'number' && Number.isFinite(value);

export const fixed = (value, digits) => (known(value) ? value.toFixed(digits).replace('-', '−') : '–');

export const restitution = (value) => fixed(value, 3);

export const interval = (lower, upper, show) =>
  known(lower) && known(upper) ? `[${show(lower)}, ${show(upper)}]` : '';

/** One standard error, where it is known; the sign stays with its number. */
export const give = (value, show, more = '') => (known(value) ? `±\u00a0${show(value)}${more}` : '');

/** Millimetres a second with the digits that mean something. */
export function speed(value) {
  if (!known(value)) return '–';
  const mm = 1e3 * value;
  return mm >= 10 ? mm.toFixed(1) : mm >= 1 ? mm.toFixed(2) : mm.toFixed(3);
}

const HALVES = Array.from({ length: 18 }, (_, k) => 1 + k / 2);

/** Round numbers between two others on a logarithmic axis, closer where these are near. */
export function roundNumbers(low, high) {
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const found = [[1], [1, 2, 5], [1, 1.5, 2, 3, 4, 5, 7], HALVES].map((digits) => {
    const all = [];
    for (let power = first; power <= last; power += 1) {
      for (const digit of digits) all.push(Number(`${digit}e${power}`));
    }
    return all.filter((one) => one >= low && one <= high);
  });
  return found.find((some) => some.length >= 3) ?? found[3];
}

export function duration(seconds) {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}

const COR_STATES = {
  cooling: 'provisional, while the gas cools',
  final: 'final for this cycle',
  no_decay: 'no decay seen yet',
  undetermined: 'the decay tells too little yet',
};

export const corState = (cor) => COR_STATES[cor.status] ?? String(cor.status);

/** What the headline is from, and what the decay alone says where contacts contradict it. */
export function source(cor, contacts) {
  if (cor.headline !== 'contacts') return contacts ? `, with ${contacts} single contact${contacts === 1 ? '' : 's'}` : '';
  const decay = known(cor.decay_restitution) ? ` (the decay says ${restitution(cor.decay_restitution)})` : '';
  return `, from ${contacts} contacts alone, since ${cor.headline_reason}${decay}`;
}

/** Whether an estimate is one, and not only what is probable before anything is known. */
export const saysSomething = (cor) => !!cor && known(cor.restitution) && ['cooling', 'final'].includes(cor.status);

/** What is wrong with the pictures of a tray, or with what was made of them. */
export const flags = ({ speed: now, cor }) =>
  [...new Set([...(now?.quality ?? []), ...(cor?.quality ?? [])])].map((one) => one.replaceAll('_', ' '));

/** What these flags mean and what to do, and why a restitution is not known; a line for each. */
export const flagTexts = ({ speed: now, cor }) =>
  [...new Set([...(now?.flags ?? []), ...(cor?.flags ?? []), ...(cor?.reason ? [cor.reason] : [])])].join('\n');

/** The value of a sticking speed, and what is to be said of it. */
export function sticking(cluster) {
  const between = interval(cluster.sticking_speed_lower, cluster.sticking_speed_upper, speed);
  switch (cluster.sticking_status) {
    case 'measured':
      return [`${speed(cluster.sticking_speed)} mm/s`, between];
    case 'no_merge':
      return known(cluster.sticking_speed_upper)
        ? [`< ${speed(cluster.sticking_speed_upper)} mm/s`, 'no beads stick yet']
        : ['', 'no beads stick yet'];
    case 'no_upper_limit':
      return known(cluster.sticking_speed_lower)
        ? [`> ${speed(cluster.sticking_speed_lower)} mm/s`, 'no upper limit']
        : ['', 'no upper limit'];
    case 'stuck_from_the_start':
      return ['', 'beads stick from the start'];
    default:
      return ['', 'not known yet'];
  }
}

/** How fast a gas slows the beads, and what is to be said of it. */
export function drag(cor) {
  if (!cor || !known(cor.drag)) return ['', 'not known yet'];
  const show = (value) => fixed(value, cor.drag_error >= 0.01 ? 3 : 4);
  const error = give(cor.drag_error, show, ', ');
  return [`${show(cor.drag)} 1/s`, `${error}part of its speed that a bead in flight loses each second`];
}

/** What drives all beads the same way: an upper limit; its size where that matters. */
export function acceleration(cor) {
  if (!cor || !known(cor.acceleration_upper)) return ['', 'not known yet'];
  const mm = (value) => (1e3 * value).toFixed(value >= 1e-3 ? 1 : 3);
  if (cor.quality.includes('accelerated')) {
    const between = interval(cor.acceleration_lower, cor.acceleration_upper, mm);
    return [`${mm(cor.acceleration)} mm/s²`, `${between} of all beads: the tray falls or turns`];
  }
  return [`< ${mm(cor.acceleration_upper)} mm/s²`, 'of all beads alike; 0 where the tray floats'];
}

/** How the restitution of the beads goes with the impact speed, and of the walls besides. */
export function exponent(cor) {
  if (!cor || !known(cor.restitution_exponent)) return ['', 'not known yet'];
  const show = (value) => fixed(value, 2);
  const between = interval(cor.restitution_exponent_lower, cor.restitution_exponent_upper, show);
  const walls = known(cor.wall_restitution_exponent)
    ? `, walls ${show(cor.wall_restitution_exponent)} ${interval(cor.wall_restitution_exponent_lower, cor.wall_restitution_exponent_upper, show)}`
    : '';
  return [show(cor.restitution_exponent), `${between} at ${speed(cor.impact_speed)} mm/s${walls}; 0: constant`];
}

/** What a tray does at present: a state for its colour, words, and fewer words. */
export function trayState(tray, silentFor) {
  const shaken = tray.start !== null && tray.start !== undefined;
  // The truth is told whether anybody measures or not.
  const { truth: _, ...measured } = tray.latest;
  if (tray.opened) return ['waiting', `cycle ${tray.cycle}, as it was`, 'over'];
  if (Object.keys(measured).length === 0) return ['waiting', 'nothing measured yet', 'waiting'];
  if (silentFor > 4) {
    const since = duration(silentFor);
    return ['warning', `silent for ${since}`, `silent ${since}`];
  }
  if (!shaken && !tray.latest.cor) return ['waiting', 'no shaking event yet', 'not shaken yet'];
  const status = tray.latest.cor?.status;
  if (status === 'final') return ['ok', `cycle ${tray.cycle}, over`, 'over'];
  const last = tray.rows.speed[tray.rows.speed.length - 1];
  const since = shaken && last ? ` for ${Math.floor(last[0] - tray.start)} s` : '';
  return ['ok', `cycle ${tray.cycle}, cooling${since}`, 'cooling'];
}

const LIVE_S = 5;

/**
 * Whether results come, and what is awaited where none do.
 *
 * `nodes` are those that measure; `trays` those whose results are offered, `silentFor` since when they are silent.
 */
export function linkState(state, nodes, trays, silentFor) {
  if (state !== 'open') return ['error', 'connection lost, trying again'];
  if (trays.length === 0) return ['waiting', 'waiting for the pipeline'];
  const measured = trays.filter(({ latest: { truth: _, ...results } }) => Object.keys(results).length > 0);
  if (measured.length === 0) {
    // A node that starts tells what it compiles (nodes/base/compile_progress.py), or waits for.
    const starting = nodes.find(({ text }) => /^(compiling|starting)/.test(text));
    if (starting) return ['waiting', starting.text];
    return ['waiting', nodes.length === 0 ? 'compiling, waiting for the pipeline' : 'waiting for the first results'];
  }
  const silent = Math.min(...measured.map(silentFor));
  return silent < LIVE_S ? ['ok', 'live'] : ['warning', `no results for ${duration(silent)}`];
}
