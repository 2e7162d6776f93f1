"""Restitutions and sticking speed of cycles in which beads stick to bodies that turn.

Tracks of `turning_gas`, 24 s after a kick to 10 mm/s, with mean speeds that have errors of 2 %,
through all stages behind the tracker; no camera. "Holds" is the share of 95 % intervals with the
truth, those from 0 to 1 among them. ``docs/validation/sticking_accuracy.md`` has the conclusions.
"""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks.turning_gas import RATE, Gas, pictures
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.records import (
    BodyEstimate,
    CorEstimate,
    Measured,
    Merge,
    PairCollision,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import CoolingSettings, PipelineSettings
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.clusters.sticking_estimator import StickingEstimator
from nanorocks_ros.stages.contacts.body_rebounds import BodyRebounds
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate
    from nanorocks_ros.records import ArrayRecord, Interval, Tracks

_TRAYS = (1, 3)
_STICKING = (1e-3, 3e-3, 10e-3)
_CYCLES = 40
_SECONDS = 24.0
_BEADS, _WALLS = 0.89, 0.97
_EVERY, _ERROR = 3, 0.02
_FINAL_ONLY = PipelineSettings(cooling=CoolingSettings(update_interval=60.0))
# Within which a sticking speed counts as right; rebounds from which on the walls are determined.
_FACTOR, _ENOUGH = 1.3, 10


class StuckCycle(NamedTuple):
    """What one cycle gives."""

    restitution: CorEstimate
    sticking: StickingEstimate | None


def stuck_cycle(number: int, sticking: float, seed: int, seconds: float = _SECONDS) -> StuckCycle:
    """The final estimates of one cycle of a tray.

    Parameters
    ----------
    number : int
        Of the tray.
    sticking : float, [m/s]
    seed : int
    seconds : float, [s]
        Length of the cycle.
    """
    tray = load_trays()[number]
    restitution = RestitutionEstimator(_FINAL_ONLY, tray)
    speed = StickingEstimator(_FINAL_ONLY, tray)
    estimates: list[CorEstimate] = []
    last_ns = 0
    for record in _records(number, Gas(_BEADS, walls=_WALLS, sticking=sticking), seed, seconds):
        if isinstance(record, SpeedEstimate):
            last_ns = record.stamp_ns
        if isinstance(record, SpeedEstimate | BodyEstimate | Merge | PairCollision):
            speed.push(record)
        if not isinstance(record, BodyEstimate):
            estimates += restitution.push(record)
    estimates += restitution.flush()
    return StuckCycle(estimates[-1], speed.of_cycle(1, last_ns))


def _records(number: int, gas: Gas, seed: int, seconds: float) -> Iterator[ArrayRecord]:
    """Speeds, contacts and bodies of a cycle, in the order in which they become known."""
    tray = load_trays()[number]
    finder, counter = ContactFinder(tray), BodyCounter(_FINAL_ONLY, tray)
    rebounds = BodyRebounds(tray)
    noise = np.random.default_rng([seed, number, 3])
    for frame, picture in enumerate(pictures(tray, gas, seed, round(seconds * RATE))):
        yield from finder.push(picture.tracks)
        for body in counter.push(picture.tracks):
            if isinstance(body, Merge):
                rebounds.push(body)
            yield body
        rebounds.noise = finder.noise
        yield from rebounds.push(picture.tracks)
        if frame % _EVERY == 0:
            yield _speed(picture.tracks, noise.standard_normal())
    yield from rebounds.flush()


def _speed(tracks: Tracks, noise: float) -> SpeedEstimate:
    speed = float(np.hypot(*tracks.velocities.T).mean()) * math.exp(_ERROR * noise)
    return SpeedEstimate(
        stamp_ns=tracks.stamp_ns,
        tray=tracks.tray,
        cycle=1,
        cycle_start_ns=0,
        mean_projected_speed=Measured(speed, _ERROR * speed),
        window=_EVERY / RATE,
        method=SpeedMethod.TRACKING,
        tray_speed=0.0,
    )


_HEADER = (
    '\n| tray, sticking speed | cycles | rebounds, of bodies, collisions: median | walls known, '
    f'with {_ENOUGH} rebounds | hold | half-width | median error | beads known | hold | '
    'half-width | median error | sticking speed / truth: mean (sd) of those measured, within a '
    f'factor of {_FACTOR} | hold |\n' + '| --- ' * 13 + '|'
)


def _row(number: int, sticking: float, cycles: Sequence[StuckCycle]) -> str:
    estimates = [cycle.restitution for cycle in cycles]
    counts = np.array([(cor.rebounds, cor.body_rebounds, cor.collisions) for cor in estimates])
    enough = [cor.wall_restitution for cor in estimates if cor.rebounds >= _ENOUGH]
    walls = _cells([cor.wall_restitution for cor in estimates], _WALLS)
    known = sum(math.isfinite(interval.value) for interval in enough)
    cells = (
        f'{number}, {1e3 * sticking:g} mm/s',
        f'{len(cycles)}',
        ', '.join(f'{median:g}' for median in np.median(counts, axis=0)),
        f'{walls[0]}, {known} of {len(enough)}',
        *walls[1:],
        *_cells([cor.restitution for cor in estimates], _BEADS),
        *_sticking_cells([cycle.sticking for cycle in cycles], sticking),
    )
    return f'| {" | ".join(cells)} |'


def _cells(intervals: Sequence[Interval], truth: float) -> tuple[str, ...]:
    """Intervals with a value, share of all with limits that hold, and how good the values are."""
    limited = [interval for interval in intervals if math.isfinite(interval.upper)]
    holds = np.mean([interval.lower <= truth <= interval.upper for interval in limited])
    known = np.array(
        [
            (interval.value - truth, 0.5 * (interval.upper - interval.lower))
            for interval in intervals
            if math.isfinite(interval.value)
        ]
    ).reshape(-1, 2)
    if not known.size:
        return '0', f'{holds:.2f}', '', ''
    error, half_width = np.median(known, axis=0)
    return f'{len(known)}', f'{holds:.2f}', f'{half_width:.4f}', f'{error:+.4f}'


def _sticking_cells(estimates: Sequence[StickingEstimate | None], truth: float) -> tuple[str, str]:
    known = [estimate for estimate in estimates if estimate is not None]
    holds = np.mean([estimate.lower <= truth <= estimate.upper for estimate in known])
    ratios = np.array([estimate.sticking_speed for estimate in known]) / truth
    ratios = ratios[np.isfinite(ratios)]
    within = np.mean(np.abs(np.log(ratios)) < math.log(_FACTOR))
    return (
        f'{ratios.mean():.2f} ({ratios.std():.2f}) of {ratios.size}, {within:.0%}',
        f'{holds:.2f}',
    )


def _cycle_of(task: tuple[int, float, int]) -> StuckCycle:
    return stuck_cycle(*task)


def report(trays: tuple[int, ...] = _TRAYS, cycles: int = _CYCLES) -> None:
    """Print the table.

    Parameters
    ----------
    trays : tuple of int
    cycles : int
        Of each row.
    """
    print(_HEADER)
    for number in trays:
        for sticking in _STICKING:
            tasks = {
                f'{number} {sticking} {seed}': (number, sticking, seed) for seed in range(cycles)
            }
            print(_row(number, sticking, run_tasks(_cycle_of, tasks, Workers())), flush=True)


if __name__ == '__main__':
    report(tuple(int(number) for number in sys.argv[2:]) or _TRAYS, int(sys.argv[1]))
