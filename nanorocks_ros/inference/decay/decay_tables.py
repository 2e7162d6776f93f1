"""Decay library tabulated on a grid of restitutions, with its slopes by the nuisances.

Tested by ``test/inference/test_posterior.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.inference.decay.decay_library import (
    LOWEST_WALL,
    NUISANCES,
    UNITS,
    count_step,
)
from nanorocks_ros.inference.decay.friction_terms import FRICTION
from nanorocks_ros.numerics.smoothing import savitzky_golay

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.decay_library import DecayLibrary
    from nanorocks_ros.settings import PriorSettings

# Nodes of the grid along each restitution, denser towards 1: evenly spaced in these powers of
# 1 - restitution, in which likelihoods are smooth.
_BEAD_NODES, _WALL_NODES = 35, 20
BEAD_POWER, WALL_POWER = 1.0 / 1.5, 0.5
# Frictions at which decays are compared, beside 0.
FRICTIONS = (0.004, 0.012, 0.035, 0.1)
# Cells of ln t over which curves of the library are smoothed, and the order of the fits.
_SMOOTH_CELLS, _SMOOTH_ORDER = 9, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class RoughTables:
    """A library of beads that rub on the same grid.

    Parameters
    ----------
    friction : float
        Of floor, lid and side walls.
    mean
        As of `DecayTables`.
    bead_slope : ndarray (n_c * n_w, n_x)
        Change of ln f for one standard deviation of one more nuisance, the friction of the beads.
        Those of the others are those of smooth beads, and kept once.
    """

    friction: float
    mean: NDArray[np.float64]
    bead_slope: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayTables:
    """The library on a grid of restitutions.

    Parameters
    ----------
    decays : DecayLibrary
    restitution : ndarray (n_c,)
    wall_restitution : ndarray (n_w,)
    mean : ndarray (n_c * n_w, n_x)
        Of ln f, over the priors of the nuisances.
    slopes : ndarray (n_c * n_w, n_z, n_x)
        Change of ln f for one standard deviation of each nuisance; without those of the camera.
    corners : ndarray of int64, (n_c * n_w, 4)
        Corners around each point, in the grid of the covariances.
    shares : ndarray (n_c * n_w, 4)
        Their weights.
    start : tuple of 2 floats
        Prior of the logarithm of the mean projected speed at the start, [m/s]: mean and standard
        deviation.
    rough : tuple of RoughTables
        With rising friction; empty if the library knows smooth beads alone.
    """

    decays: DecayLibrary
    restitution: NDArray[np.float64]
    wall_restitution: NDArray[np.float64]
    mean: NDArray[np.float64]
    slopes: NDArray[np.float64]
    corners: NDArray[np.int64]
    shares: NDArray[np.float64]
    start: tuple[float, float]
    rough: tuple[RoughTables, ...] = ()


@lru_cache(maxsize=16)
def tables_of(library: DecayLibrary, tray: Tray, settings: PriorSettings) -> DecayTables:
    """The library on the grid of restitutions, with the effect of each nuisance.

    Parameters
    ----------
    library : DecayLibrary
    tray : Tray
    settings : PriorSettings
        Standard deviations of the nuisances.
    """
    restitution = 1.0 - np.linspace(1.0, 0.0, _BEAD_NODES) ** (1.0 / BEAD_POWER)
    wall = 1.0 - (1.0 - LOWEST_WALL) * np.linspace(1.0, 0.0, _WALL_NODES) ** (1.0 / WALL_POWER)
    beads, walls = (axis.ravel() for axis in np.meshgrid(restitution, wall, indexing='ij'))
    mean = library.log_speed(beads, walls)
    slope, shift = _floor_and_lid(library, beads, walls, settings.floor_lid_spread, mean)
    slopes, shifts = [slope], shift
    for number, spread in enumerate(_spreads(tray, settings)):
        change = np.zeros((beads.size, len(NUISANCES)))
        change[:, number] = UNITS[number]
        high = library.log_speed(beads, walls, None, change)
        low = library.log_speed(beads, walls, None, -change)
        share = spread / UNITS[number]
        slopes.append(0.5 * (high - low) * share)
        shifts += (0.5 * (high + low) - mean) * share**2
    corners, shares = _corners(library, beads, walls)
    return DecayTables(
        decays=library,
        restitution=restitution,
        wall_restitution=wall,
        mean=_smooth(mean + shifts),
        slopes=_smooth(np.stack(slopes, axis=1)),
        corners=corners,
        shares=shares,
        start=(math.log(settings.initial_speed), settings.initial_speed_spread),
        rough=tuple(
            _rough_tables(
                library,
                (beads, walls),
                friction,
                settings.bead_friction_spread,
                shifts,
            )
            for friction in (FRICTIONS if library.rough else ())
        ),
    )


def _rough_tables(
    library: DecayLibrary,
    restitutions: tuple[NDArray[np.float64], NDArray[np.float64]],
    friction: float,
    spread: float,
    shifts: NDArray[np.float64],
) -> RoughTables:
    """Decays with a friction of walls and beads, and their change with that of beads alone.

    `shifts` is by how much the nuisances change the mean of smooth beads.
    """
    beads, walls = restitutions

    def log_speed(beads_over_walls: float) -> NDArray[np.float64]:
        point = np.zeros((beads.size, len(FRICTION)))
        point[:, 0], point[:, 1] = friction, beads_over_walls
        return library.log_speed(beads, walls, None, None, point)

    change = 0.5 * (log_speed(spread) - log_speed(-spread))
    return RoughTables(
        friction=friction,
        mean=_smooth(log_speed(0.0) + shifts),
        bead_slope=_smooth(change),
    )


def _smooth(curves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Curves of the library without the noise of its runs.

    Their slopes determine how far amplitude and scale compensate each other. Where the speed falls
    as 1/t they nearly do, so that noise of 0.01 from cell to cell would dominate.
    """
    return savitzky_golay(curves, _SMOOTH_CELLS, _SMOOTH_ORDER)


def _spreads(tray: Tray, settings: PriorSettings) -> tuple[float, ...]:
    """One standard deviation of each of `NUISANCES`."""
    counted = all(species.mass is None for species in tray.species)
    count = settings.count_error / count_step(tray) if counted else 1.0
    return (
        settings.height_error,
        settings.diameter_error,
        settings.anisotropy_spread,
        count,
        settings.speed_distribution_spread,
    )


def _floor_and_lid(
    library: DecayLibrary,
    beads: NDArray[np.float64],
    walls: NDArray[np.float64],
    spread: float,
    mean: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Change of ln f when the loss at floor and lid is exp(spread) times that at the sides.

    And its mean change for a standard deviation of `spread`.
    """
    if spread == 0.0:
        return np.zeros_like(mean), np.zeros_like(mean)
    more, less = (1.0 - (1.0 - walls) * math.exp(logarithm) for logarithm in (spread, -spread))
    high = library.log_speed(beads, walls, more)
    low = library.log_speed(beads, walls, less)
    return 0.5 * (high - low), 0.5 * (high + low) - mean


def _corners(
    library: DecayLibrary, beads: NDArray[np.float64], walls: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Corners of the covariance grid around each point, and their weights."""
    falling = -library.covariance_restitution
    rising = library.covariance_wall
    i, s = _cell(falling, -beads)
    j, t = _cell(rising, walls)
    width = rising.size
    corners = np.stack(
        [i * width + j, i * width + j + 1, (i + 1) * width + j, (i + 1) * width + j + 1], axis=1
    )
    shares = np.stack([(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t], axis=1)
    return corners, shares


def _cell(
    axis: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    cell = np.clip(np.searchsorted(axis, at, side='right') - 1, 0, axis.size - 2)
    share = (at - axis[cell]) / (axis[cell + 1] - axis[cell])
    return cell.astype(np.int64), np.clip(share, 0.0, 1.0)
