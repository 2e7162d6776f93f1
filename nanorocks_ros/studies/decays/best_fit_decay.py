"""The library decay that fits measured decays best, and its restitutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.cooling_age import cooling_age
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import decay_likelihood
from nanorocks_ros.inference.decay.decay_tables import DecayTables, tables_of
from nanorocks_ros.inference.decay.grid_likelihood import DecayLikelihood
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.settings import PipelineSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve

_HALF = 0.5 * 0.95
# Range of ln(initial speed / first speed used). Below 0: the speed of a mixture that starts with
# equal speeds rises at first.
_LOG_SPEED_RATIOS = (-1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryDecay:
    """Best fitting decay of the library of a tray.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Since the shaking event.
    speed : ndarray (n,), [m/s]
        Mean projected speed for the likeliest restitutions, with the likeliest tray, start and
        camera within their priors.
    initial_speed : float, [m/s]
        Mean projected speed when the gas began to cool; on a tray that swung, by `cooling_age`.
    restitution, wall_restitution : tuple of 3 floats
        Median, lower and upper end of the 95 % interval, from all cycles with the default
        priors.
    """

    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    initial_speed: float
    restitution: tuple[float, float, float]
    wall_restitution: tuple[float, float, float]


def library_decay(
    tray: Tray,
    cycles: Sequence[CycleSpeeds],
    curve: SpeedCurve,
    start: float = 0.0,
    walls: tuple[float, float] | None = None,
) -> LibraryDecay:
    """Fit measured decays by the library of their tray.

    Parameters
    ----------
    tray : Tray
    cycles : sequence of CycleSpeeds
    curve : SpeedCurve
        Mean of the cycles over the times that are used.
    start : float, [s]
        When the gas begins to cool freely, since the shaking event.
    walls : tuple of 2 floats, optional
        Ends of the flat prior of the wall restitution; the default one if not given.

    Raises
    ------
    ConfigurationError
        When there is no library of this tray.
    FitError
        When fewer than 4 speeds of a cycle lie in the cooling window.
    """
    prior = PipelineSettings().prior
    library = library_of(tray)
    tables = tables_of(library, tray, prior)
    camera = (math.hypot(prior.scale_error, library.misfit), prior.speed_bias)
    # As the restitution stage: the first part still depends on the shaking.
    first = max(float(curve.times[0]), start + PipelineSettings().cooling.delay)
    age = cooling_age(start)
    began = start - age.value
    likelihoods = []
    for cycle in cycles:
        in_window = (cycle.times >= first - 1e-9) & (cycle.times <= curve.times[-1] + 1e-9)
        in_window &= cycle.error > 0.0
        if in_window.sum() < 4:
            raise FitError(f'cycle {cycle.cycle}', 'is too short', 'choose a longer time')
        decay = cycle.times[in_window] - began, cycle.speed[in_window], cycle.error[in_window]
        # The figures assume smooth beads; likelihoods at frictions would take most of the time.
        likelihoods.append(
            decay_likelihood(tables, *decay, camera, highest_friction=0.0, start_error=age.error)
        )
    together = reduce(add, likelihoods)
    integrated = together.integrated()
    low, high = walls or (prior.min_wall_restitution, prior.max_wall_restitution)
    posterior = posterior_of(tables, integrated, (low, high))
    # At least one node of the walls: the nearest.
    off = np.maximum(
        np.maximum(low - tables.wall_restitution, tables.wall_restitution - high), 0.0
    )
    possible = np.where(off <= off.min(), integrated.reshape(-1, off.size), -np.inf).ravel()
    ends = np.array([0.5, 0.5 - _HALF, 0.5 + _HALF])
    beads, sides = posterior.quantiles(ends), posterior.wall_quantiles(ends)
    cooling = curve.times >= first - 1e-9
    speed, initial = _best_decay(
        tables, together, possible, curve.times[cooling] - began, curve.speed[cooling], camera
    )
    return LibraryDecay(
        times=curve.times[cooling],
        speed=speed,
        initial_speed=initial,
        restitution=(float(beads[0]), float(beads[1]), float(beads[2])),
        wall_restitution=(float(sides[0]), float(sides[1]), float(sides[2])),
    )


def _best_decay(
    tables: DecayTables,
    likelihood: DecayLikelihood,
    integrated: NDArray[np.float64],
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    camera: tuple[float, float],
) -> tuple[NDArray[np.float64], float]:
    """The likeliest decay and its initial speed."""
    best_point = int(np.argmax(integrated))
    # Likeliest nuisance parameters there, in standard deviations.
    matrix = np.eye(likelihood.gradient.shape[1]) + likelihood.information[best_point]
    offsets = np.linalg.solve(matrix, likelihood.gradient[best_point])
    of_tray = tables.slopes.shape[1]
    scale, bias = offsets[of_tray : of_tray + len(camera)] * np.array(camera)
    mean = tables.mean[best_point] + offsets[:of_tray] @ tables.slopes[best_point]
    log_distances = np.log(tables.decays.distances)
    bias_term = bias * (np.log(speed) - np.log(speed).mean())

    def log_speed(log_initial: float) -> NDArray[np.float64]:
        # Lengths in the image are larger by exp(scale) than the calibration says.
        true = log_initial + scale
        position = (true + np.log(time) - log_distances[0]) / tables.decays.step
        # Extrapolated linearly beyond the ends, as in the likelihood.
        cell = np.clip(np.floor(position).astype(np.int64), 0, mean.size - 2)
        log_decay = mean[cell] + (position - cell) * (mean[cell + 1] - mean[cell])
        return np.asarray(log_initial + log_decay + bias_term)

    def misfit(log_initial: float) -> float:
        return float(np.sum((np.log(speed) - log_speed(log_initial)) ** 2))

    bounds = tuple(float(np.log(speed[0])) + lead for lead in _LOG_SPEED_RATIOS)
    best = optimize.minimize_scalar(misfit, bounds=bounds, method='bounded').x
    return np.exp(log_speed(float(best))), math.exp(float(best))
