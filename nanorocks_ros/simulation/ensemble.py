"""Many runs of one tray, from shaking to rest, without leaving compiled code."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.physics.compiled import compiled
from nanorocks_ros.simulation.engine.checks import check_room, check_times
from nanorocks_ros.simulation.engine.gas import MOST_EVENTS
from nanorocks_ros.simulation.engine.kernel import run_until
from nanorocks_ros.simulation.engine.prediction import predict_all
from nanorocks_ros.simulation.engine.state import COUNTS, DONE, PAIR, WALL, Rules, new_state
from nanorocks_ros.simulation.initial import (
    MOST_TRIES,
    draw_diameters,
    place,
    rules_of,
    shaken_velocities,
    sphere_masses,
    stock,
)
from nanorocks_ros.simulation.randomness import Purpose, key_for
from nanorocks_ros.simulation.shaking import check_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import SimulationSettings
    from nanorocks_ros.experiment.trays import Tray

_NO_ROOM = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingRuns:
    """Mean speeds of a cooling gas, run by run.

    Parameters
    ----------
    times : ndarray (n_times,), [s]
        Since the shaking event.
    mean_speed, mean_projected_speed : ndarray (n_runs, n_times), [m/s]
        Over the beads.
    pair_collisions, wall_collisions : ndarray of int64, (n_runs,)
    """

    times: NDArray[np.float64]
    mean_speed: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    pair_collisions: NDArray[np.int64]
    wall_collisions: NDArray[np.int64]


def cooling_runs(
    settings: SimulationSettings,
    tray: Tray,
    times: Sequence[float] | NDArray[np.float64],
    runs: Iterable[int],
) -> CoolingRuns:
    """Let a tray cool after one shaking event, for each of some runs.

    A run starts where `ShakenTray` of the same seed and run is after a shaking event at
    time 0, event by event.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    times : array_like (n_times,), [s]
        Since the shaking event; rising.
    runs : iterable of int
        Numbers of the runs.

    Raises
    ------
    ConfigurationError
        For a setting outside its range.
    SimulationError
        When the beads do not fit, or a run has too many events.
    """
    check_settings(settings)
    drawn = stock(tray)
    rules = rules_of(settings, tray).compiled()
    check_room(0.5 * drawn.diameter_high, rules)
    last = float(np.max(times)) if np.size(times) else 0.0
    instants = check_times(0.0, last, times)
    numbers = list(runs)
    purposes = (Purpose.DIAMETERS, Purpose.POSITIONS, Purpose.VELOCITIES)
    keys = np.array(
        [[key_for(settings.seed, run, one) for one in purposes] for run in numbers],
        dtype=np.uint64,
    ).reshape(len(numbers), len(purposes))
    speeds = np.empty((len(numbers), 2, instants.size))
    counts = np.zeros((len(numbers), COUNTS), dtype=np.int64)
    ranges = np.stack((drawn.diameter_low, drawn.diameter_high, drawn.density))
    for k, run in enumerate(numbers):
        status = _cool(rules, ranges, keys[k], settings.mean_speed, instants, speeds[k], counts[k])
        _check_status(status, tray, run)
    return CoolingRuns(
        times=instants,
        mean_speed=speeds[:, 0],
        mean_projected_speed=speeds[:, 1],
        pair_collisions=counts[:, PAIR],
        wall_collisions=counts[:, WALL],
    )


def _check_status(status: int, tray: Tray, run: int) -> None:
    where = f'tray {tray.number}, run {run}'
    if status == _NO_ROOM:
        raise SimulationError(where, 'found no room for all beads', 'give fewer or smaller beads')
    if status != DONE:
        raise SimulationError(
            where, f'more than {MOST_EVENTS} events', 'raise the restitution or shorten the run'
        )


@compiled
def _cool(
    rules: Rules,
    ranges: NDArray[np.float64],
    keys: NDArray[np.uint64],
    mean_speed: float,
    times: NDArray[np.float64],
    speeds: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> int:
    """One run; writes mean speeds (2, n_times) and counts, and returns how it ended."""
    diameters = draw_diameters(ranges[0], ranges[1], keys[0])
    n = diameters.size
    sides = np.array((rules.side_x, rules.side_y, rules.side_z))
    radii = 0.5 * diameters
    start, placed = place(radii, sides, keys[1], MOST_TRIES)
    if placed < n:
        return _NO_ROOM
    kicked = shaken_velocities(n, mean_speed, keys[2], 0)
    state = new_state(start, kicked, radii, sphere_masses(diameters, ranges[2]))
    predict_all(state, rules, 0.0)
    positions = np.empty((times.size, n, 3))
    velocities = np.empty((times.size, n, 3))
    end = times[-1] if times.size else 0.0
    status = run_until(state, rules, end, MOST_EVENTS, times, positions, velocities)
    for k in range(times.size):
        speeds[0, k] = 0.0
        speeds[1, k] = 0.0
        for i in range(n):
            v = velocities[k, i]
            in_plane = v[0] * v[0] + v[1] * v[1]
            speeds[0, k] += math.sqrt(in_plane + v[2] * v[2])
            speeds[1, k] += math.sqrt(in_plane)
        speeds[0, k] /= n
        speeds[1, k] /= n
    counts[:] = state.counts
    return status
