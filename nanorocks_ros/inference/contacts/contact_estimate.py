"""Restitution with its error from a log likelihood on a grid, for reports.

Tested by ``test/inference/contacts/test_contact_likelihood.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from nanorocks_ros.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class ContactEstimate(NamedTuple):
    """A restitution from a log likelihood alone, for reports.

    Parameters
    ----------
    restitution, restitution_error : float
        Maximum of the interpolated likelihood; standard deviation.
    lower, upper : float
        Ends of the central 68 % interval.
    """

    restitution: float
    restitution_error: float
    lower: float
    upper: float


def contact_estimate(restitution: ArrayLike, log_likelihood: ArrayLike) -> ContactEstimate:
    """Restitution from a log likelihood on an even grid, with a flat prior.

    Raises
    ------
    FitError
        When the log likelihood is constant or not finite.
    """
    grid = checked_grid('restitution', restitution)
    values = np.asarray(log_likelihood, dtype=np.float64)
    if values.shape != grid.shape or not np.isfinite(values).all() or np.ptp(values) == 0.0:
        raise FitError(
            'contact_estimate',
            f'a constant or infinite log likelihood of shape {values.shape} for {grid.size} '
            'values',
            'give that of at least one contact, on the same grid',
        )
    # A fine grid: a peak may be narrower than the distance of nodes.
    fine = np.linspace(grid[0], grid[-1], 20 * grid.size)
    logs = np.interp(fine, grid, values) if grid.size < 4 else _spline(grid, values, fine)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    mean = float(weights @ fine)
    total = np.cumsum(weights) - 0.5 * weights
    lower, upper = np.interp((0.16, 0.84), total, fine)
    return ContactEstimate(
        restitution=float(fine[np.argmax(logs)]),
        restitution_error=math.sqrt(float(weights @ (fine - mean) ** 2)),
        lower=float(lower),
        upper=float(upper),
    )


def _spline(
    grid: NDArray[np.float64], values: NDArray[np.float64], fine: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray(CubicSpline(grid, values)(fine))


def checked_grid(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """A grid of restitutions, (n,).

    Raises
    ------
    FitError
        When it is empty, or holds a value outside [0, 1].
    """
    grid = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if grid.ndim != 1 or not grid.size or not ((grid >= 0.0) & (grid <= 1.0)).all():
        raise FitError(name, f'{values!r} is no list of values in [0, 1]', 'correct the grid')
    return grid
