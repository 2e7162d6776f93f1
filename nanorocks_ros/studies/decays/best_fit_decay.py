"""The simulated decay that agrees best with measured ones, and what it says of restitutions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.decay_likelihood import (
    DecayLikelihood,
    DecayTables,
    decay_likelihood,
)
from nanorocks_ros.inference.decay.decay_tables import tables_of
from nanorocks_ros.inference.posterior import posterior_of
from nanorocks_ros.settings import PipelineSettings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve

_HALF = 0.5 * 0.95
# ln of the speed at the start over the first one used, at least and at most: a mixture that starts
# with equal speeds becomes faster at first.
_LEADS = (-1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryDecay:
    """A decay of the library of a tray beside measured ones.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Since the shaking event.
    speed : ndarray (n,), [m/s]
        Mean projected, of the likeliest pair of restitutions; with tray, start and camera as they
        are likeliest then, within their priors.
    initial_speed : float, [m/s]
        The same when the gas began to cool.
    restitution, wall_restitution : tuple of 3 floats
        Median of what all cycles say with the default priors, lower and upper end of the 95 %
        interval.
    """

    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    initial_speed: float
    restitution: tuple[float, float, float]
    wall_restitution: tuple[float, float, float]


def library_decay(
    tray: Tray, cycles: Sequence[CycleSpeeds], curve: SpeedCurve, start: float = 0.0
) -> LibraryDecay:
    """Hold measured decays against the library of their tray.

    Parameters
    ----------
    tray : Tray
    cycles : sequence of CycleSpeeds
    curve : SpeedCurve
        Their mean over the times that are to be used.
    start : float, [s]
        From when on the gas cools, since the shaking event.

    Raises
    ------
    ConfigurationError
        When there is no library of such a tray.
    FitError
        When fewer than 4 speeds of a cycle lie in the cooling window.
    """
    known = PipelineSettings().prior
    library = library_of(tray)
    tables = tables_of(library, tray, known)
    camera = (math.hypot(known.scale_error, library.misfit), known.speed_bias)
    # As the stage does: the gas has to forget how it was shaken.
    first = max(float(curve.times[0]), start + PipelineSettings().cooling.delay)
    likelihoods = []
    for one in cycles:
        used = (one.times >= first - 1e-9) & (one.times <= curve.times[-1] + 1e-9)
        used &= one.error > 0.0
        if used.sum() < 4:
            raise FitError(f'cycle {one.cycle}', 'is too short', 'choose a longer time')
        decay = one.times[used] - start, one.speed[used], one.error[used]
        likelihoods.append(decay_likelihood(tables, *decay, camera))
    together = reduce(add, likelihoods)
    integrated = together.integrated()
    posterior = posterior_of(
        tables, integrated, (known.min_wall_restitution, known.max_wall_restitution)
    )
    ends = np.array([0.5, 0.5 - _HALF, 0.5 + _HALF])
    beads, walls = posterior.quantiles(ends), posterior.wall_quantiles(ends)
    late = curve.times >= first - 1e-9
    speed, initial = _matched(
        tables, together, integrated, curve.times[late] - start, curve.speed[late], camera
    )
    return LibraryDecay(
        times=curve.times[late],
        speed=speed,
        initial_speed=initial,
        restitution=(float(beads[0]), float(beads[1]), float(beads[2])),
        wall_restitution=(float(walls[0]), float(walls[1]), float(walls[2])),
    )


def _matched(
    tables: DecayTables,
    likelihood: DecayLikelihood,
    integrated: NDArray[np.float64],
    time: NDArray[np.float64],
    speed: NDArray[np.float64],
    camera: tuple[float, float],
) -> tuple[NDArray[np.float64], float]:
    """The likeliest decay with the initial speed that fits best, and that speed."""
    place = int(np.argmax(integrated))
    # Tray, start and camera as they are likeliest there, in standard deviations.
    matrix = np.eye(likelihood.gradient.shape[1]) + likelihood.information[place]
    off = np.linalg.solve(matrix, likelihood.gradient[place])
    own, (scale, bias) = off[: -len(camera)], off[-len(camera) :] * np.array(camera)
    mean = tables.mean[place] + own @ tables.slopes[place]
    log_distances = np.log(tables.decays.distances)
    tilt = bias * (np.log(speed) - np.log(speed).mean())

    def log_speed(log_initial: float) -> NDArray[np.float64]:
        # Lengths of the tray are that much longer in the picture than they are taken for.
        true = log_initial + scale
        at = (true + np.log(time) - log_distances[0]) / tables.decays.step
        # Straight on beyond the ends, as where the likelihood is worked out.
        cell = np.clip(np.floor(at).astype(np.int64), 0, mean.size - 2)
        found = mean[cell] + (at - cell) * (mean[cell + 1] - mean[cell])
        return np.asarray(log_initial + found + tilt)

    def misfit(log_initial: float) -> float:
        return float(np.sum((np.log(speed) - log_speed(log_initial)) ** 2))

    bounds = tuple(float(np.log(speed[0])) + lead for lead in _LEADS)
    best = optimize.minimize_scalar(misfit, bounds=bounds, method='bounded').x
    return np.exp(log_speed(float(best))), math.exp(float(best))
