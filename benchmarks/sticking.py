"""Bodies, sizes, first merges and sticking speeds from tracks, against the truth.

True positions at 30 Hz with errors as in tracking, 58 s after a shaking event at
10 mm/s. Tracks of films are in `sticking_films`. False merges are counted in gases that are drawn
from the priors, as those of `drawn_films`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import binomtest

from benchmarks.contacts import tracks_of
from benchmarks.drawn_films import drawn_gas
from nanorocks_ros.experiment.trays import Tray, load_trays
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle, sticking_cycle
from nanorocks_ros.inference.sticking.sticking_speed import sticking_estimate
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import BodyEstimate, Merge, Tracks
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.bodies.body_counter import BodyCounter

_RATE = 30.0
_SECONDS = 58.0
_SPEED = 0.010
_TRAYS = (1, 3, 5)
_STICKING = (1e-3, 3e-3, 5e-3, 10.4e-3)
_CYCLES = 6
_CONTROLS = 300
_NS = 1e9


@dataclass(frozen=True)
class Course:
    """A cycle with counted and true bodies; true values are those at the frames.

    Parameters
    ----------
    counts : list of BodyEstimate
    merges : list of Merge
    times : ndarray (n,), [s]
    bodies, weighted_size, speeds : ndarray (n,)
        True; mean projected speed of the beads, [m/s].
    """

    counts: list[BodyEstimate]
    merges: list[Merge]
    times: np.ndarray
    bodies: np.ndarray
    weighted_size: np.ndarray
    speeds: np.ndarray

    @property
    def first_true(self) -> float:
        """Time of the first true merge, [s]; NaN without."""
        fell = self.bodies < self.bodies.max()
        return float(self.times[np.argmax(fell)]) if fell.any() else np.nan

    @property
    def first(self) -> float:
        """Time of the first detected merge, [s]; NaN without."""
        return min((merge.stamp_ns / _NS for merge in self.merges), default=np.nan)


def course(tray: Tray, pictures: Iterable[tuple[Tracks, np.ndarray, float]]) -> Course:
    """Count the bodies of a cycle.

    Parameters
    ----------
    tray : Tray
    pictures : iterable of (Tracks, bodies, mean projected speed)
        True number of the body of each bead; speed in [m/s].
    """
    counter = BodyCounter(PipelineSettings(), tray)
    records: list[BodyEstimate | Merge] = []
    rows = []
    for tracks, bodies, speed in pictures:
        records += counter.push(replace(tracks, cycle=1))
        sizes = np.unique(bodies, return_counts=True)[1]
        rows.append((tracks.stamp_ns / _NS, sizes.size, (sizes**2).sum() / sizes.sum(), speed))
    records += counter.flush()
    times, numbers, sizes, speeds = np.array(rows).T
    return Course(
        counts=[record for record in records if isinstance(record, BodyEstimate)],
        merges=[record for record in records if isinstance(record, Merge)],
        times=times,
        bodies=numbers,
        weighted_size=sizes,
        speeds=speeds,
    )


def simulated(
    number: int, run: int, seed: int = 5, seconds: float = _SECONDS, **values: float | str
) -> Course:
    """One cycle of a tray with true positions."""
    names = {'restitution': 0.89, 'wall_restitution': 0.97, 'mean_speed': _SPEED, **values}
    return _simulated(load_trays()[number], run, seed, seconds, names)


def _simulated(
    tray: Tray, run: int, seed: int, seconds: float, values: Mapping[str, float | str]
) -> Course:
    cycle = {'seed': seed, 'first_shake': 0.0, 'frame_rate': _RATE}
    settings = with_values(SimulationSettings(), {**values, **cycle}, 'benchmark')
    gas = ShakenTray(settings, tray, run)
    rng = np.random.default_rng([seed, run])
    pictures = tracks_of(gas, tray, rng, round(seconds * _RATE))
    return course(
        tray,
        ((picture, gas.bodies, np.hypot(*picture.velocities.T).mean()) for picture in pictures),
    )


def _report_controls() -> None:
    print('\nGases without sticking, drawn from the priors\n')
    print('| tray | cycles | with a false merge | 95 % |')
    print('| --- | --- | --- | --- |')
    tasks = {f'{number} {run}': (number, run) for number in _TRAYS for run in range(_CONTROLS)}
    alarms = np.reshape(run_tasks(_false_alarm, tasks, Workers()), (len(_TRAYS), _CONTROLS))
    for number, tray_alarms in zip(_TRAYS, alarms, strict=True):
        limits = binomtest(int(tray_alarms.sum()), _CONTROLS).proportion_ci(method='exact')
        print(
            f'| {number} | {_CONTROLS} | {tray_alarms.sum()} '
            f'| {limits.low:.1%} to {limits.high:.1%} |',
            flush=True,
        )


def compared(cycle: Course) -> tuple[np.ndarray, ...]:
    """Time, bodies, their error and truth, weighted size, its error and truth: (7, n)."""
    rows = [
        (
            count.stamp_ns / _NS,
            count.bodies.value,
            count.bodies.error,
            count.weighted_size.value,
            count.weighted_size.error,
        )
        for count in cycle.counts
    ]
    times, bodies, error, size, size_error = np.array(rows).T
    indices = np.searchsorted(cycle.times, times - 1e-6)
    return (
        times,
        bodies,
        error,
        cycle.bodies[indices],
        size,
        size_error,
        cycle.weighted_size[indices],
    )


def size_row(cycles: list[Course]) -> str:
    """Cells of the table of sizes, over some cycles."""
    columns = [np.concatenate(part) for part in zip(*map(compared, cycles), strict=True)]
    _, bodies, error, true, size, size_error, true_size = columns
    ratio = size / true_size - 1.0
    onset = np.array([cycle.first - cycle.first_true for cycle in cycles])
    known_onsets = onset[np.isfinite(onset)]
    delays = [
        (merge.known_ns - merge.stamp_ns) / _NS for cycle in cycles for merge in cycle.merges
    ]
    covered = np.mean(np.abs(bodies - true) <= np.maximum(2.0 * error, 0.5))
    covered_size = np.mean(np.abs(size - true_size) <= np.maximum(2.0 * size_error, 0.1))
    lines = [
        f'{np.mean([cycle.bodies[-1] for cycle in cycles]):.1f}',
        f'{np.mean(bodies - true):+.2f} ({np.sqrt(np.mean((bodies - true) ** 2)):.2f})',
        f'{ratio.mean():+.1%} ({np.sqrt(np.mean(ratio**2)):.1%})',
        f'{covered:.0%}, {covered_size:.0%}',
        f'{np.mean([cycle.first_true for cycle in cycles]):.2f}',
        f'{known_onsets.mean():+.2f} ({np.abs(known_onsets).max():.2f}), '
        f'{len(known_onsets)}/{len(cycles)}'
        if known_onsets.size
        else 'none found',
        f'{np.median(delays):.2f}, {np.quantile(delays, 0.9):.2f}' if delays else '',
    ]
    return ' | '.join(lines)


SIZE_HEADER = (
    'bodies at the end | error of bodies: mean (rms) | of weighted size | within 2 errors: '
    'bodies, size | first merge [s] | found later by: mean (largest) [s], in | known after '
    '[s]: median, 90 % |'
)


def _report_sizes(courses: dict[tuple[int, float], list[Course]]) -> None:
    print(f'\nTrue places with the errors of tracking, {_CYCLES} cycles each\n')
    print(f'| tray, sticking speed | {SIZE_HEADER}')
    print('| --- |' + ' --- |' * 7)
    for (number, speed), cycles in courses.items():
        print(f'| {number}, {1e3 * speed:g} mm/s | {size_row(cycles)} |', flush=True)


def threshold_cycle(course: Course, beads: int, merges: list[Merge]) -> StickingCycle:
    stamps = np.rint(course.times[1:] * _NS).astype(np.int64)
    return sticking_cycle(beads, merges, stamps, course.speeds[1:], 0)


def true_merges(times: np.ndarray, bodies: np.ndarray, beads: int) -> list[Merge]:
    """All true merges, from times and numbers of bodies, (n,)."""
    fallen = -np.diff(bodies, prepend=beads)
    stamps = np.rint(np.repeat(times, fallen.astype(np.int64)) * _NS).astype(np.int64)
    fields = {'tray': 0, 'cycle': 1, 'tracks': np.zeros(2, dtype=np.int32), 'joins': True}
    return [Merge(stamp_ns=int(stamp_ns), known_ns=int(stamp_ns), **fields) for stamp_ns in stamps]


def threshold_row(number: int, speed: float, cycles: list[Course], measure: str) -> str:
    """Cells of the table of sticking speeds."""
    tray = load_trays()[number]
    contacts = slow_contacts(tray)
    measured = [threshold_cycle(cycle, tray.count, cycle.merges) for cycle in cycles]
    true = [
        threshold_cycle(cycle, tray.count, true_merges(cycle.times, cycle.bodies, tray.count))
        for cycle in cycles
    ]
    estimates = [
        sticking_estimate([cycle], contacts, tray.count, measure=measure) for cycle in measured
    ]
    ratios = np.array([estimate.sticking_speed for estimate in estimates]) / speed
    covered = sum(estimate.lower <= speed <= estimate.upper for estimate in estimates)
    cells = [
        f'{np.nanmean(ratios):.2f} ({np.nanstd(ratios):.2f}) of {np.isfinite(ratios).sum()}',
        f'{covered}/{len(estimates)}',
    ]
    for sample in (measured, true):
        estimate = sticking_estimate(sample, contacts, tray.count, measure=measure)
        cells.append(
            f'{estimate.sticking_speed / speed:.2f} '
            f'[{estimate.lower / speed:.2f}, {estimate.upper / speed:.2f}]'
        )
    return ' | '.join(cells)


def _report_thresholds(
    courses: dict[tuple[int, float], list[Course]], measure: str = 'normal'
) -> None:
    print('\nSticking speed, along the line of centres, over the truth, by true speeds\n')
    print(
        '| tray, sticking speed | of one cycle: mean (sd) of those measured | '
        '95 % intervals that hold the truth | of all cycles [95 %] | from the true merges |'
    )
    print('| --- |' + ' --- |' * 4)
    for (number, speed), cycles in courses.items():
        row = threshold_row(number, speed, cycles, measure)
        print(f'| {number}, {1e3 * speed:g} mm/s | {row} |', flush=True)


def _cycle_of(task: tuple[int, float, int]) -> Course:
    number, speed, run = task
    return simulated(number, run, sticking_speed=speed)


def _false_alarm(task: tuple[int, int]) -> bool:
    number, run = task
    tray, values = drawn_gas(number, run, 0.0, 0.0)
    return bool(_simulated(tray, run, 7, _SECONDS, values).merges)


def report() -> None:
    """Print the tables."""
    tasks = {
        f'{number} {speed} {run}': (number, speed, run)
        for number in _TRAYS
        for speed in _STICKING
        for run in range(_CYCLES)
    }
    courses: dict[tuple[int, float], list[Course]] = {}
    results = run_tasks(_cycle_of, tasks, Workers())
    for (number, speed, _), result in zip(tasks.values(), results, strict=True):
        courses.setdefault((number, speed), []).append(result)
    _report_sizes(courses)
    _report_thresholds(courses)
    _report_controls()
