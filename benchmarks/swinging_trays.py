"""Decays on trays that swing: how old the gas is when they come to rest, and what it then says.

Truths are drawn as for drawn films: beads and walls 0.5 to 1, all else from the priors, and a
swing of the scene from 0.05 to 0.3 mm, which knocks the beads. Each gives true mean projected
speeds with errors of 2 %, from the moment at which the tray is slower than
`cooling.max_tray_to_bead_speed` times the beads. "Share": with the factor k by which the gas is
faster there than the same gas on a tray at rest, 1 - 1/k, means of 8 runs each. "Just shaken":
times count as if the gas had been shaken when the tray came to rest; "aged": by `cooling_age`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.drawn import varied
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.cooling_age import cooling_age
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.jobs.tasks import Workers, run_tasks
from nanorocks_ros.records import Measured
from nanorocks_ros.settings import (
    CoolingSettings,
    PriorSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.simulation.plate_scene.plate_oscillation import wall_motion_of
from nanorocks_ros.simulation.shaken_tray import ShakenTray

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

_TRAYS = (1, 3, 5, 7)
_CYCLES, _RUNS = 150, 8
_BEADS = (0.5, 1.0)
_SPEEDS = (6e-3, 14e-3)
_SWINGS = (0.05e-3, 0.3e-3)
_STEP, _LAST = 0.1, 45.0
_LEAST = 3.0
_ERROR = 0.02
_LEVELS = np.array([0.025, 0.16, 0.5, 0.84, 0.975])
_HALF_WIDTHS = 3.0
_PRIOR, _COOLING = PriorSettings(), CoolingSettings()
_NO_AGE = Measured(0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Truth:
    """A tray that swings, and its gas."""

    number: int
    tray: Tray
    simulation: SimulationSettings
    scene: SceneSettings

    def speeds(self, run: int, *, swings: bool) -> NDArray[np.float64]:
        """Mean projected speed at `_times()`, [m/s]."""
        motion = wall_motion_of(self.simulation, self.scene) if swings else None
        gas = ShakenTray(self.simulation, self.tray, run, motion)
        velocities = (gas.at(time)[1] for time in _times().tolist())
        return np.array([np.hypot(*velocity[:, :2].T).mean() for velocity in velocities])

    @property
    def tray_speed(self) -> NDArray[np.float64]:
        """Root of the mean square of the speed of the tray at `_times()`, [m/s]."""
        scene = self.scene
        fastest = 2.0 * math.pi * scene.swing_frequency * scene.swing
        return np.asarray(fastest * math.sqrt(0.5) * np.exp(-scene.swing_damping * _times()))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Result:
    """What one truth gives; intervals are `_LEVELS` of beads, with known and with free walls."""

    beads: float
    rest: float
    share: float
    intervals: NDArray[np.float64]


def report() -> None:
    """Print the table."""
    print(
        '| tray | cycles | at rest after [s] | share | walls | gas | beads: bias | sd '
        '| covered 68 % | 95 % | half | far off |'
    )
    print('| --- ' * 12 + '|')
    for tray in _TRAYS:
        tasks = {f'{tray}_{cycle}': (tray, cycle) for cycle in range(_CYCLES)}
        results = [result for result in run_tasks(_result, tasks, Workers()) if result]
        rest, share = (
            np.array([getattr(result, name) for result in results]) for name in ('rest', 'share')
        )
        for row, walls in enumerate(('known', 'free')):
            for column, gas in enumerate(('just shaken', 'aged')):
                first = f'| {tray} | {len(results)} | {np.median(rest):.1f} '
                first += f'| {share.mean():.3f} ± {share.std(ddof=1):.3f} '
                start = first if (row, column) == (0, 0) else '| ' * 4
                cells = _judged(results, row, column)
                print(f'{start}| {walls} | {gas} {cells}', flush=True)


def _judged(results: list[_Result], row: int, column: int) -> str:
    limits = np.array([result.intervals[row, column] for result in results])
    beads = np.array([result.beads for result in results])
    errors, half = limits[:, 2] - beads, 0.5 * (limits[:, 4] - limits[:, 0])
    covered = [
        np.mean((limits[:, low] <= beads) & (beads <= limits[:, high]))
        for low, high in ((1, 3), (0, 4))
    ]
    far = int(np.sum(np.abs(errors) > _HALF_WIDTHS * half))
    return (
        f'| {errors.mean():+.3f} | {errors.std(ddof=1):.3f} | {covered[0]:.2f} '
        f'| {covered[1]:.2f} | {half.mean():.3f} | {far} |'
    )


def _times() -> NDArray[np.float64]:
    return np.arange(_COOLING.delay, _LAST, _STEP)


def _result(task: tuple[int, int]) -> _Result | None:
    """What a truth gives; None where the tray swings to the end, or not long enough to matter."""
    truth = _drawn(*task)
    swung = [truth.speeds(run, swings=True) for run in range(_RUNS)]
    calm = truth.tray_speed < _COOLING.max_tray_to_bead_speed * swung[0]
    first = int(np.argmax(calm))
    time = _times()
    if not calm.any() or first == 0 or time[first] > _LAST - _LEAST:
        return None
    rest = float(time[first]) - _COOLING.delay
    still = [truth.speeds(run, swings=False)[first] for run in range(_RUNS)]
    faster = np.mean([speed[first] for speed in swung]) / np.mean(still)
    random = np.random.default_rng([31, *task])
    speed = swung[0] * np.exp(_ERROR * random.standard_normal(time.size))
    used = (time >= time[first]) & (time < rest + _COOLING.duration)
    wall = truth.simulation.wall_restitution
    walls = (wall, wall), (_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution)
    intervals = [
        [_quantiles(task[0], time[used] - rest, speed[used], age, ends) for age in _ages(rest)]
        for ends in walls
    ]
    return _Result(
        beads=truth.simulation.restitution,
        rest=rest,
        share=float(1.0 - 1.0 / faster),
        intervals=np.array(intervals),
    )


def _ages(rest: float) -> tuple[Measured, Measured]:
    return _NO_AGE, cooling_age(rest)


def _drawn(number: int, cycle: int) -> _Truth:
    random = np.random.default_rng([2027, number, cycle])
    wall = random.uniform(_PRIOR.min_wall_restitution, _PRIOR.max_wall_restitution)
    tray, values = varied(load_trays()[number], wall, _PRIOR, random)
    values |= {
        'restitution': random.uniform(*_BEADS),
        'wall_restitution': wall,
        'mean_speed': math.exp(random.uniform(*np.log(_SPEEDS))),
    }
    simulation = with_values(
        SimulationSettings(first_shake=0.0, shake_period=2.0 * _LAST, seed=6000 + cycle),
        values,
        'benchmark',
    )
    scene = replace(
        SceneSettings(),
        swing=random.uniform(*_SWINGS),
        swing_direction=random.uniform(-math.pi, math.pi),
    )
    return _Truth(number=number, tray=tray, simulation=simulation, scene=scene)


def _quantiles(
    number: int,
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    age: Measured,
    walls: tuple[float, float],
) -> NDArray[np.float64]:
    """Quantiles of the beads, given times since the tray was at rest and the age of the gas."""
    tray = load_trays()[number]
    library = library_of(tray)
    tables = tables_of(library, tray, _PRIOR)
    scale, bias = math.hypot(_PRIOR.scale_error, library.misfit), _PRIOR.speed_bias
    if any(species.properties.shape == 'grain' for species in tray.species):
        scale, bias = math.hypot(scale, _PRIOR.grain_scale_error), _PRIOR.grain_speed_bias
    decay = decay_likelihood(
        tables,
        age.value + time,
        speed,
        _ERROR * speed,
        (scale, bias),
        highest_friction=0.0,
        start_error=age.error,
    )
    return posterior_of(tables, decay.integrated(), walls).quantiles(_LEVELS)
