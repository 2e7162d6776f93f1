"""Coefficient of friction of the side walls, from the tangential speeds of rebounds.

A wall with friction slows a bead along the wall by at most friction times the change of its normal
speed (Coulomb), so that of all rebounds the tangential loss over that change is the friction, and
less where beads slip partly in the vertical direction or roll: the value is a lower estimate.

A rebound is only recorded where the tangential speed is the same within `TANGENTIAL_SIGMAS`
errors, which hides large losses. The likelihood of a loss is therefore that of a Gaussian cut off
there, and remains unbiased for sliding beads.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import log_ndtr

from nanorocks_ros.inference.contacts.contact_likelihood import ERROR_SCALES, OUTLIERS, marginal
from nanorocks_ros.inference.likelihood_1d import Likelihood1D
from nanorocks_ros.records import Measured

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Rebound

FRICTIONS = np.linspace(-0.05, 0.3, 701)
"""Grid of the likelihood; negative values keep the estimate of smooth walls unbiased."""
TANGENTIAL_SIGMAS = 4.0
"""Largest change of the tangential speed of a recorded rebound, in its errors: that of
``stages.contacts``."""

_SQRT_2_PI = math.sqrt(2.0 * math.pi)


def friction_table(rebounds: Sequence[Rebound]) -> NDArray[np.float64]:
    """Log likelihood of the tangential speeds for each scale of errors and each of `FRICTIONS`.

    Parameters
    ----------
    rebounds : sequence of Rebound
        Those of bodies are left out: their beads change tangential speeds by turning, too.

    Returns
    -------
    ndarray (m, n)
        Log likelihood up to a constant; 0 without rebounds. Tables of more rebounds add up.
    """
    rebounds = [rebound for rebound in rebounds if rebound.beads == 1]
    if not rebounds:
        return np.zeros((len(ERROR_SCALES), FRICTIONS.size))
    before, after, error, change = np.array(
        [
            (rebound.tangential_incoming, rebound.tangential_outgoing, rebound.tangential_error,
             rebound.incoming.value + rebound.outgoing.value)
            for rebound in rebounds
        ]
    ).T  # fmt: skip
    loss = (np.sign(before) * (before - after) / error)[:, np.newaxis]
    # A correction for drag may take a recorded rebound across the cut. There the density of a
    # large friction would grow without limit, and one rebound decide.
    loss = np.clip(loss, -TANGENTIAL_SIGMAS, TANGENTIAL_SIGMAS)
    expected = FRICTIONS * (change / error)[:, np.newaxis]
    by_scale = []
    for scale in ERROR_SCALES:
        upper = log_ndtr((TANGENTIAL_SIGMAS - expected) / scale)
        lower = log_ndtr((-TANGENTIAL_SIGMAS - expected) / scale)
        within = upper + np.log(-np.expm1(np.minimum(lower - upper, -1e-12)))
        log_density = -0.5 * ((loss - expected) / scale) ** 2 - math.log(scale * _SQRT_2_PI)
        likely = math.log1p(-OUTLIERS) + log_density - within
        outlier = math.log(OUTLIERS / (2.0 * TANGENTIAL_SIGMAS))
        by_scale.append(np.logaddexp(likely, outlier).sum(axis=0))
    return np.array(by_scale)


def friction_likelihood(table: NDArray[np.float64]) -> Likelihood1D:
    """Log likelihood over `FRICTIONS`; the table as for `wall_friction`."""
    return Likelihood1D(restitution=FRICTIONS, log_likelihood=marginal(table))


def wall_friction(table: NDArray[np.float64]) -> Measured:
    """Mean and standard deviation of the friction, for a flat prior over `FRICTIONS`.

    Parameters
    ----------
    table : ndarray (m, n)
        From `friction_table`, or a sum of such.
    """
    posterior = friction_likelihood(table).posterior((float(FRICTIONS[0]), float(FRICTIONS[-1])))
    return Measured(posterior.mean, posterior.deviation)
