"""Bodies that turn: false alarms, first merges and sticking speeds, against the truth.

Tracks of `turning_gas`, 40 s after a kick to 10 mm/s; no camera.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from benchmarks.sticking import Course, course, threshold_cycle, true_merges
from benchmarks.turning_gas import RATE, Gas, pictures
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate, sticking_estimate
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.physics.sticking_rates import slow_contacts
from nanorocks_ros.records import StickingStatus

_TRAYS = (1, 3)
_SECONDS = 40.0
_CONTROLS = 100
_CONTROL_TRUTHS = (0.5, 0.9)
# Seeds of cycles without sticking begin here.
_FIRST_CONTROL = 1000
_CYCLES = 48
_STICKING = (1e-3, 3e-3, 10e-3)
# Within which a sticking speed, and the time of a first merge, [s], count as right.
_FACTOR, _ONSET = 1.3, 0.5


class Turning(NamedTuple):
    """One cycle, counted, with its true contacts: see `turning_gas.Picture`."""

    course: Course
    contacts: np.ndarray


def turning(number: int, gas: Gas, seed: int, seconds: float = _SECONDS) -> Turning:
    """One cycle of a tray, counted."""
    tray = load_trays()[number]
    contacts: list[np.ndarray] = []

    def frames():
        for frame in pictures(tray, gas, seed, round(seconds * RATE)):
            contacts.append(frame.contacts)
            yield frame.tracks, frame.bodies, np.hypot(*frame.tracks.velocities.T).mean()

    return Turning(course(tray, frames()), np.concatenate(contacts))


def _estimate(cycles: list[Course], number: int, *, true: bool = False) -> StickingEstimate:
    """Sticking speed from the merges found, or from the true ones."""
    tray = load_trays()[number]
    merges = [
        true_merges(cycle.times, cycle.bodies, tray.count) if true else cycle.merges
        for cycle in cycles
    ]
    return sticking_estimate(
        [
            threshold_cycle(cycle, tray.count, own)
            for cycle, own in zip(cycles, merges, strict=True)
        ],
        slow_contacts(tray),
        tray.count,
    )


def _between_contacts(contacts: np.ndarray) -> float:
    """Best sticking speed if all speeds of contacts were known, [m/s]: its limits' middle.

    The limits are the fastest contact that stuck and the slowest that did not.
    """
    speeds, stuck = contacts[:, 0], contacts[:, 1] > 0.0
    return 0.5 * (speeds[stuck].max(initial=0.0) + speeds[~stuck].min(initial=np.inf))


def _scatter(ratios: np.ndarray) -> str:
    """Mean, standard deviation and number of the known ratios; share of all within the factor."""
    known = ratios[np.isfinite(ratios)]
    within = np.count_nonzero(np.abs(np.log(known)) < np.log(_FACTOR))
    return (
        f'{np.mean(known):.2f} ({np.std(known):.2f}) of {known.size}, '
        f'{within}/{known.size} = {within / known.size:.0%}'
        if known.size
        else 'none'
    )


def _row(number: int, speed: float, runs: list[Turning]) -> str:
    cycles = [run.course for run in runs]
    late = np.array([cycle.first - cycle.first_true for cycle in cycles])
    late = late[np.isfinite(late)]
    merges = np.array([sum(merge.joins for merge in cycle.merges) for cycle in cycles])
    true = np.array([cycle.bodies[0] - cycle.bodies[-1] for cycle in cycles])
    estimates = [_estimate([cycle], number) for cycle in cycles]
    ideal = [_estimate([cycle], number, true=True) for cycle in cycles]
    holds, ideal_holds = (
        sum(estimate.lower <= speed <= estimate.upper for estimate in both)
        for both in (estimates, ideal)
    )
    wrong_limits = sum(
        estimate.upper < speed
        for estimate in estimates
        if estimate.status is StickingStatus.NO_MERGE
    )
    both = _estimate(cycles, number)
    cells = (
        f'{number}, {1e3 * speed:g} mm/s',
        f'{len(cycles)}',
        f'{merges.sum()} of {true.sum():.0f}',
        f'{np.mean(late):+.2f}, {np.abs(late).max(initial=0.0):.2f}, '
        f'{np.count_nonzero(np.abs(late) <= _ONSET)}/{len(cycles)}',
        _scatter(np.array([estimate.sticking_speed for estimate in estimates]) / speed),
        _scatter(np.array([estimate.sticking_speed for estimate in ideal]) / speed),
        _scatter(np.array([_between_contacts(run.contacts) for run in runs]) / speed),
        f'{holds}/{len(cycles)}, {ideal_holds}/{len(cycles)}',
        f'{wrong_limits}',
        f'{both.sticking_speed / speed:.2f} [{both.lower / speed:.2f}, {both.upper / speed:.2f}]',
    )
    return f'| {" | ".join(cells)} |'


def _sticking(task: tuple[int, float, int]) -> Turning:
    number, speed, seed = task
    return turning(number, Gas(0.89, sticking=speed), seed)


def _false_alarm(task: tuple[int, float, int]) -> bool:
    number, eps, seed = task
    return bool(turning(number, Gas(eps), seed).course.merges)


def _report_controls(trays: tuple[int, ...], runs: int) -> None:
    print('| tray | restitution | cycles without sticking | with a merge |\n' + '| --- ' * 4 + '|')
    seeds = range(_FIRST_CONTROL, _FIRST_CONTROL + runs)
    for number in trays:
        for eps in _CONTROL_TRUTHS:
            tasks = {f'{number} {eps} {seed}': (number, eps, seed) for seed in seeds}
            alarms = run_tasks(_false_alarm, tasks, Workers())
            print(f'| {number} | {eps} | {runs} | {sum(alarms)} |', flush=True)


_HEADER = (
    (
        '\n| tray, sticking speed | cycles | merges found | first merge found later by: mean, '
        f'largest [s], within {_ONSET} s | speed / truth, one cycle: mean (sd) of those '
        f'measured, within a factor of {_FACTOR} | the same from the true merges | the same if '
        'the speeds of all contacts were known | 95 % hold: merges found, true | upper limits '
        'below the truth | all cycles [95 %] |\n'
    )
    + '| --- ' * 10
    + '|'
)


def report(trays: tuple[int, ...] = _TRAYS, share: float = 1.0) -> None:
    """Print the tables.

    Parameters
    ----------
    trays : tuple of int
    share : float
        Of the number of cycles.
    """
    _report_controls(trays, round(share * _CONTROLS))
    print(_HEADER)
    for number in trays:
        for speed in _STICKING:
            runs = round(share * _CYCLES)
            tasks = {f'{number} {speed} {seed}': (number, speed, seed) for seed in range(runs)}
            cycles = run_tasks(_sticking, tasks, Workers())
            print(_row(number, speed, cycles), flush=True)


if __name__ == '__main__':
    report(tuple(int(number) for number in sys.argv[2:]) or _TRAYS, float(sys.argv[1]))
