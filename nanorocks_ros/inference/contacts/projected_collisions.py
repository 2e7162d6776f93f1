"""Likelihood of collisions in the projection of the camera.

A tilted line of centres appears shortened, and so does the speed along it.

Tested by ``test/inference/contacts/test_contact_likelihood.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtr

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import PairCollision

RANGE = 2.0
"""Range of speeds after an outlier, in units of the speed before."""

_HEIGHTS = 16
# Error of distances, relative to the sum of the radii, from the steps between values of
# `RadiusExcess` that are compared.
_SCALE_STEP = 0.001
# Collisions per batch: their arrays over all tilts, restitutions and ratios stay in the cache.
_IN_CACHE = 4
# Standard deviations beyond which the tail of a Gaussian is below the precision of a double.
_ALL_ABOVE = 9.0
_TINY = 1e-300
# Tilts of the line of centres with a smaller weight are left out.
_UNLIKELY = 1e-9
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


class ProjectedCollisions(NamedTuple):
    """Collisions along the projected line of centres, arrays (m,).

    Parameters
    ----------
    approach, parting : ndarray, [m/s]
        Relative speed before and after.
    approach_variance, parting_variance, covariance : ndarray, [m^2/s^2]
    distance, distance_error : ndarray, [m]
        Projected, of the centres at contact; the error of the sum of radii is in its error.
    reach, measured, height : ndarray, [m]
        Sum of radii, sum of the measured radii alone, and height of the tray.
    radii : ndarray (m, 2), [m]
    temperature : ndarray, [m^2/s^2]
        Sum over both beads.
    """

    approach: NDArray[np.float64]
    parting: NDArray[np.float64]
    approach_variance: NDArray[np.float64]
    parting_variance: NDArray[np.float64]
    covariance: NDArray[np.float64]
    distance: NDArray[np.float64]
    distance_error: NDArray[np.float64]
    reach: NDArray[np.float64]
    measured: NDArray[np.float64]
    height: NDArray[np.float64]
    radii: NDArray[np.float64]
    temperature: NDArray[np.float64]

    @classmethod
    def of(cls, collisions: Sequence[PairCollision]) -> ProjectedCollisions:
        """Arrays of some collisions."""
        separation = np.array([collision.separation for collision in collisions])
        distance = np.hypot(*separation.T)
        normal = separation / distance[:, None]
        before = np.array([collision.before[1] - collision.before[0] for collision in collisions])
        after = np.array([collision.after[1] - collision.after[0] for collision in collisions])
        error = np.array([collision.separation_error for collision in collisions])
        radii = np.array([collision.radii for collision in collisions])
        radius_errors = np.array([collision.radius_errors for collision in collisions])
        across = np.column_stack([-normal[:, 1], normal[:, 0]])
        # An error of the direction of the line of centres mixes in the speed across it.
        turned = error / distance
        slip = [np.sum(velocity * across, axis=1) * turned for velocity in (before, after)]
        noise = [
            np.array([np.sum(getattr(collision, name) ** 2) for collision in collisions])
            for name in ('before_errors', 'after_errors')
        ]
        return cls(
            approach=-np.sum(before * normal, axis=1),
            parting=np.sum(after * normal, axis=1),
            approach_variance=noise[0] + slip[0] ** 2,
            parting_variance=noise[1] + slip[1] ** 2,
            covariance=-slip[0] * slip[1],
            distance=distance,
            distance_error=np.hypot(error, np.hypot(*radius_errors.T)),
            reach=radii.sum(axis=1),
            measured=np.where(radius_errors > 0.0, radii, 0.0).sum(axis=1),
            height=np.array([collision.height for collision in collisions]),
            radii=radii,
            temperature=np.array([collision.temperatures.sum() for collision in collisions]),
        )

    def with_errors(self, scale: float) -> ProjectedCollisions:
        """The collisions with all errors multiplied by a factor."""
        return self._replace(
            approach_variance=scale**2 * self.approach_variance,
            parting_variance=scale**2 * self.parting_variance,
            covariance=scale**2 * self.covariance,
            distance_error=scale * self.distance_error,
        )


class RadiusExcess(NamedTuple):
    """By how much radii exceed those that distances at contact tell, relative.

    Parameters
    ----------
    all_radii : float
        Of all radii: outlines are blurred, and beads above the floor are nearer to the camera.
    measured : float
        Besides, of radii that are measured bead by bead: beads of a species differ in size.
    """

    all_radii: float
    measured: float


def _tilts(
    seen: ProjectedCollisions, excess: RadiusExcess
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Tilts (vertical components of the line of centres), (1, h), and densities, (m, h).

    Lines of centres are isotropic within the height of the tray; the projected distance is
    measured with its error. The densities are those of this distance, relative to the sum of the
    radii, together with the tilt: their sum over the tilts tells how likely the radii are.
    """
    # Dense where lines are level: there a small tilt changes how well the speeds are known.
    ends = (np.arange(_HEIGHTS + 1) / _HEIGHTS) ** 2
    tilt = ((np.arange(_HEIGHTS) + 0.5)[None, :] / _HEIGHTS) ** 2
    known = seen.reach - seen.measured
    reach = seen.measured * (1.0 - excess.measured) + known
    reach = ((1.0 - excess.all_radii) * reach)[:, None]
    free = seen.height[:, None] - 2.0 * seen.radii
    above = tilt * reach
    room = np.minimum(free.min(axis=1)[:, None], 0.5 * free.sum(axis=1)[:, None] - above)
    room = np.maximum(room, 0.0) * np.diff(ends)
    # In a tray as high as a bead all lines of centres are level.
    room[:, 0] = np.where(room.max(axis=1) > 0.0, room[:, 0], 1.0)
    error = np.hypot(seen.distance_error, _SCALE_STEP * seen.reach)[:, None]
    # Distances may be known better than these tilts are apart: the mean from tilt to tilt.
    distances = reach * np.sqrt(1.0 - ends**2)
    shares = ndtr((distances - seen.distance[:, None]) / error)
    density = seen.reach[:, None] * np.diff(shares) / np.diff(distances)
    return tilt, room / room.sum(axis=1)[:, None] * density


def horizontal_parts(
    seen: ProjectedCollisions, excess: RadiusExcess
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Horizontal part of the unit line of centres, (m,), and its standard deviation, (m,)."""
    tilt, density = _tilts(seen, excess)
    part = np.sqrt(1.0 - tilt[0] ** 2)
    # Far from all tilts the nearest is taken.
    density[:, 0] += _TINY
    weight = density / density.sum(axis=1)[:, None]
    mean = weight @ part
    spread = np.sqrt(np.maximum(weight @ part**2 - mean**2, 0.0))
    return mean, spread


def projected_log_likelihood(
    seen: ProjectedCollisions,
    grid: NDArray[np.float64],
    ratios: NDArray[np.float64],
    excesses: Sequence[RadiusExcess],
    limits: tuple[float, float],
) -> NDArray[np.float64]:
    """Log likelihood, (r, e, n), of collisions for vertical ratios, (r,), and excesses, (e,)."""
    total: NDArray[np.float64] = projected_log_densities(seen, grid, ratios, excesses, limits).sum(
        axis=2
    )
    return total


def projected_log_densities(
    seen: ProjectedCollisions,
    grid: NDArray[np.float64],
    ratios: NDArray[np.float64],
    excesses: Sequence[RadiusExcess],
    limits: tuple[float, float],
    slope: float = 0.0,
) -> NDArray[np.float64]:
    """Log likelihood, (r, e, m, n), of distance and speeds of each collision.

    Parameters
    ----------
    seen : ProjectedCollisions
    grid : ndarray (n,)
        Restitutions, at the impact speed of each collision.
    ratios : ndarray (r,)
    excesses : sequence of RadiusExcess, (e,)
    limits : tuple of 2 floats
        Sticking speed, [m/s], and fraction of outliers.
    slope : float
        By how much the restitution falls where the impact speed rises by a factor e.
    """
    sticking_speed, outliers = limits
    by_excess = [_tilts(seen, excess) for excess in excesses]
    tilt, weights = by_excess[0][0], np.array([weight for _, weight in by_excess])
    likely = weights.max(axis=(0, 1)) > _UNLIKELY
    # One tilt at least.
    likely[0] |= not likely.any()
    tilt, weights = tilt[:, likely], weights[..., likely]
    logs = np.empty((ratios.size, *weights.shape[:2], grid.size))
    for k in range(0, weights.shape[1], _IN_CACHE):
        rows = slice(k, k + _IN_CACHE)
        batch = ProjectedCollisions(*(column[rows] for column in seen))
        kind = tilt[0, :, np.newaxis], sticking_speed, slope
        densities = _density(batch, grid, ratios, kind)
        # Speeds depend on the tilt, and only the tilts depend on the radii.
        density = np.einsum('emh,rmhn->remn', weights[:, rows], densities)
        # The distance of an outlier is anything up to the sum of the radii.
        outlier_density = outliers / (RANGE * batch.approach[:, np.newaxis])
        logs[:, :, rows] = np.log((1.0 - outliers) * density + outlier_density)
    return logs


def _density(
    seen: ProjectedCollisions,
    grid: NDArray[np.float64],
    ratios: NDArray[np.float64],
    kind: tuple[NDArray[np.float64], float, float],
) -> NDArray[np.float64]:
    """Density of the speeds after collisions, (r, m, h, n), for tilts (h, 1).

    `kind` is these tilts, the sticking speed and the slope of the restitution.

    The speed w along the line of centres is the projected speed times its horizontal component p,
    plus the vertical speed, a Gaussian, times the tilt. Collisions are weighted with w, for w
    above the sticking speed. All other factors are Gaussian, so that the integral is closed.
    """
    tilt, sticking_speed, slope = kind
    part = np.sqrt(1.0 - tilt**2)
    a, c, aa, cc, ac = (
        column[:, None, None]
        for column in (seen.approach, seen.parting, seen.approach_variance,
                    seen.parting_variance, seen.covariance)
    )  # fmt: skip
    vertical = tilt**2 * ratios[:, None, None, None] * seen.temperature[:, None, None]
    gain = (1.0 + grid - slope) * part
    left = gain * part - 1.0
    speed, speed_variance = part * a, part**2 * aa + vertical
    shared = gain * vertical
    shared += part * left * aa - part * ac
    variance = gain**2 * vertical
    variance += left**2 * aa + cc - 2.0 * left * ac
    miss = c - (gain * speed - a)
    # At the impact speed that both measured speeds say, the restitution is that of the grid.
    miss -= slope * (a + c) / (1.0 + grid)
    share = shared / variance
    given = speed + share * miss
    share *= shared
    given_variance = np.maximum(speed_variance - share, 0.0)
    density = np.exp(-0.5 * miss**2 / variance)
    density *= _mean_above(sticking_speed, given, given_variance)
    density /= np.sqrt(variance)
    density /= _SQRT_2_PI * _mean_above(sticking_speed, speed, speed_variance)
    return density


def _mean_above(
    least: float, mean: NDArray[np.float64], variance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Integral of x over a Gaussian density of x from `least` to infinity; never exactly 0."""
    spread = np.sqrt(variance) + _TINY
    ratio = (mean - least) / spread
    integral = np.empty(ratio.shape)
    integral[:] = mean
    # Far above `least` the integral is the mean.
    near = np.flatnonzero(ratio < _ALL_ABOVE)
    if near.size:
        x = ratio.ravel()[near]
        density = np.exp(-0.5 * np.minimum(x**2, 1e3)) / _SQRT_2_PI
        integral.ravel()[near] = integral.ravel()[near] * ndtr(x) + spread.ravel()[near] * density
    integral += _TINY
    return integral
