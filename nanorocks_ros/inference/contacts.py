"""What single contacts say of the restitution: rebounds of the walls, collisions of the beads.

Both are functions of one restitution alone, on a grid of its values, to be added to the log
likelihood of the decay. Constants that do not depend on the restitution are left out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import ndtr

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.contact_estimate import checked_grid
from nanorocks_ros.inference.log_sums import log_sum

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.records import PairCollision, Rebound

OUTLIERS = 0.05
"""Share of contacts that were something else: a wrong link, a third bead that nobody saw."""

VERTICAL_RATIOS = (0.25, 0.4, 0.6, 0.9, 1.3)
"""Mean square of the vertical over that of a horizontal velocity component; all alike likely."""

RADIUS_ERRORS = (-0.02, 0.0, 0.02, 0.04, 0.06)
"""Glass beads of 12 px came out 4 % too large in films with all effects."""

# What errors of rebounds may be over what was stated. Not less: many slow rebounds, whose errors
# are stated too large, would then lend too much weight to the few fast ones.
_ERROR_SCALES = (1.0, 1.4, 2.0, 2.8)
# The same of collisions, which tell errors from vertical speeds too badly to have it free:
# simulated cycles scatter so much more.
_PAIR_ERRORS = 1.25
# Range of speeds after a contact of the other kind, over the speed before.
_RANGE = 2.0
_HEIGHTS = 20
_AT_ONCE = 128
_TINY = 1e-300
# Vertical parts of the line of centres that are less likely are left out.
_UNLIKELY = 1e-9
_SQRT_2_PI = math.sqrt(2.0 * math.pi)


def marginal(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log likelihood, (n,), whichever row of a table is true; each as likely.

    Parameters
    ----------
    table : ndarray (m, n)
        One of those below, or a sum of some: what is not known is then the same in all of them.
    """
    return np.asarray(log_sum(table) - math.log(len(table)))


def rebound_log_likelihood(
    rebounds: Sequence[Rebound], wall_restitution: ArrayLike, *, outliers: float = OUTLIERS
) -> NDArray[np.float64]:
    """How likely some rebounds are for each of some restitutions of the side walls.

    See `rebound_table`.
    """
    return marginal(rebound_table(rebounds, wall_restitution, outliers=outliers))


def rebound_table(
    rebounds: Sequence[Rebound], wall_restitution: ArrayLike, *, outliers: float = OUTLIERS
) -> NDArray[np.float64]:
    """How likely rebounds are for each restitution of the side walls and each scale of errors.

    The speed before is as uncertain as that after, and any speed is as likely; given the speed
    before, that a rebound was found says nothing of the speed after.

    Parameters
    ----------
    rebounds : sequence of Rebound
    wall_restitution : array_like (n,), 0 to 1
    outliers : float, 0 to 1
        Share of rebounds that were something else.

    Returns
    -------
    ndarray (m, n)
        Log likelihood but for a constant; 0 without rebounds. Those of more rebounds are to be
        added.
    """
    grid = checked_grid('wall_restitution', wall_restitution)
    _check_share(outliers)
    if not rebounds:
        return np.zeros((len(_ERROR_SCALES), grid.size))
    columns = np.array(
        [
            (one.incoming, one.outgoing, one.incoming_error, one.outgoing_error,
             one.wall_velocity_error)
            for one in rebounds
        ]
    )  # fmt: skip
    incoming, outgoing, before, after, wall = columns.T[:, :, None]
    # The speed of the wall is in both speeds, with opposite signs.
    variance = (grid * before) ** 2 + after**2 + ((1.0 + grid) * wall) ** 2
    square = (outgoing - grid * incoming) ** 2 / variance
    other = outliers / (_RANGE * incoming)
    by_scale = []
    for scale in _ERROR_SCALES:
        density = np.exp(-0.5 * square / scale**2) / (_SQRT_2_PI * scale * np.sqrt(variance))
        by_scale.append(np.log((1.0 - outliers) * density + other).sum(axis=0))
    return np.array(by_scale)


def pair_log_likelihood(
    collisions: Sequence[PairCollision],
    restitution: ArrayLike,
    *,
    vertical_ratios: Sequence[float] = VERTICAL_RATIOS,
    radius_errors: Sequence[float] = RADIUS_ERRORS,
    sticking_speed: float = 0.0,
    outliers: float = OUTLIERS,
) -> NDArray[np.float64]:
    """How likely some collisions are for each of some restitutions of the beads.

    See `pair_table`.
    """
    return marginal(
        pair_table(
            collisions,
            restitution,
            vertical_ratios=vertical_ratios,
            radius_errors=radius_errors,
            sticking_speed=sticking_speed,
            outliers=outliers,
        )
    )


def pair_table(
    collisions: Sequence[PairCollision],
    restitution: ArrayLike,
    *,
    vertical_ratios: Sequence[float] = VERTICAL_RATIOS,
    radius_errors: Sequence[float] = RADIUS_ERRORS,
    sticking_speed: float = 0.0,
    outliers: float = OUTLIERS,
) -> NDArray[np.float64]:
    """How likely collisions are for each restitution, and each pair of what is not known.

    Parameters
    ----------
    collisions : sequence of PairCollision
    restitution : array_like (n,), 0 to 1
    vertical_ratios : sequence of float, > 0
        Mean square of the vertical over that of a horizontal velocity component, one of them,
        of all collisions; each as likely.
    radius_errors : sequence of float
        By what share all radii that were measured are wrong, one of them, each as likely.
    sticking_speed : float, [m/s]
        Beads that meet more slowly along the line of centres merge, and are not among these.
    outliers : float, 0 to 1
        Share of collisions that were something else.

    Returns
    -------
    ndarray (m, n)
        Log likelihood but for a constant; 0 without collisions. Those of more collisions are to
        be added.
    """
    grid = checked_grid('restitution', restitution)
    _check_share(outliers)
    if not collisions:
        return np.zeros((len(vertical_ratios) * len(radius_errors), grid.size))
    seen = _Seen.of(collisions).with_errors(_PAIR_ERRORS)
    # In parts, so that memory does not grow with the number of collisions.
    parts = [
        _Seen(*(one[k : k + _AT_ONCE] for one in seen))
        for k in range(0, len(collisions), _AT_ONCE)
    ]
    limits = sticking_speed, outliers
    # Where no radius was measured, it does not matter how wrong they are.
    errors = radius_errors if seen.measured.any() else (0.0,)
    table = [
        np.sum([_pairs_given(one, grid, ratio, error, limits) for one in parts], axis=0)
        for ratio in vertical_ratios
        for error in errors
    ]
    return np.repeat(table, len(radius_errors) // len(errors), axis=0)


class _Seen(NamedTuple):
    """What is seen of collisions, each (m,): along the projected line of centres.

    Parameters
    ----------
    approach, parting : ndarray, [m/s]
        Relative speed before and after.
    approach_variance, parting_variance, covariance : ndarray, [m^2/s^2]
    distance, distance_error : ndarray, [m]
        Projected, of the centres at contact; the error of the sum of radii is in its error.
    reach, measured, height : ndarray, [m]
        Sum of radii, of those that were measured alone, and height of the tray.
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
    def of(cls, collisions: Sequence[PairCollision]) -> _Seen:
        separation = np.array([one.separation for one in collisions])
        distance = np.hypot(*separation.T)
        normal = separation / distance[:, None]
        before = np.array([one.before[1] - one.before[0] for one in collisions])
        after = np.array([one.after[1] - one.after[0] for one in collisions])
        error = np.array([one.separation_error for one in collisions])
        radii = np.array([one.radii for one in collisions])
        radius_errors = np.array([one.radius_errors for one in collisions])
        across = np.column_stack([-normal[:, 1], normal[:, 0]])
        # A line of centres that is turned by its error mixes in the speed across it.
        turned = error / distance
        slip = [np.sum(one * across, axis=1) * turned for one in (before, after)]
        noise = [
            np.array([np.sum(getattr(one, name) ** 2) for one in collisions])
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
            height=np.array([one.height for one in collisions]),
            radii=radii,
            temperature=np.array([one.temperatures.sum() for one in collisions]),
        )

    def with_errors(self, scale: float) -> _Seen:
        """The same with so many times the errors."""
        return self._replace(
            approach_variance=scale**2 * self.approach_variance,
            parting_variance=scale**2 * self.parting_variance,
            covariance=scale**2 * self.covariance,
            distance_error=scale * self.distance_error,
        )


def _tilts(seen: _Seen, radius_error: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vertical parts of the line of centres, (1, h), and how likely they are, (m, h).

    Lines of centres point anywhere alike, as far as the height of the tray lets them; what they
    leave of the distance in the picture is seen, with its error.
    """
    tilt = (np.arange(_HEIGHTS) + 0.5)[None, :] / _HEIGHTS
    reach = (seen.reach - radius_error * seen.measured)[:, None]
    free = seen.height[:, None] - 2.0 * seen.radii
    above = tilt * reach
    room = np.minimum(free.min(axis=1)[:, None], 0.5 * free.sum(axis=1)[:, None] - above)
    square = ((reach * np.sqrt(1.0 - tilt**2) - seen.distance[:, None])
              / seen.distance_error[:, None]) ** 2  # fmt: skip
    weight = np.maximum(room, 0.0) * np.exp(-0.5 * (square - square.min(axis=1)[:, None]))
    return tilt, weight / weight.sum(axis=1)[:, None]


def _pairs_given(
    seen: _Seen,
    grid: NDArray[np.float64],
    ratio: float,
    radius_error: float,
    limits: tuple[float, float],
) -> NDArray[np.float64]:
    """Log likelihood, (n,), of collisions when vertical speeds and radii are known.

    The speed w along the line of centres is that seen times its part in the picture, p, and the
    vertical one, a Gaussian, times the other part; the more often beads meet, the larger w. All
    is Gaussian but for that factor w, w above the sticking speed, which leaves a closed form.
    """
    sticking_speed, outliers = limits
    tilt, weight = _tilts(seen, radius_error)
    likely = weight.max(axis=0) > _UNLIKELY
    tilt, weight = tilt[:, likely], weight[:, likely]
    part = np.sqrt(1.0 - tilt**2)[:, :, None]
    a, c, aa, cc, ac = (
        one[:, None, None]
        for one in (seen.approach, seen.parting, seen.approach_variance,
                    seen.parting_variance, seen.covariance)
    )  # fmt: skip
    vertical = tilt[:, :, None] ** 2 * ratio * seen.temperature[:, None, None]
    gain = (1.0 + grid) * part
    left = gain * part - 1.0
    speed, speed_variance = part * a, part**2 * aa + vertical
    both = part * left * aa + gain * vertical - part * ac
    variance = left**2 * aa + gain**2 * vertical + cc - 2.0 * left * ac
    miss = c - (gain * speed - a)
    given = speed + both / variance * miss
    given_variance = np.maximum(speed_variance - both**2 / variance, 0.0)
    density = np.exp(-0.5 * miss**2 / variance) / (_SQRT_2_PI * np.sqrt(variance))
    flux = _mean_above(sticking_speed, given, given_variance)
    flux /= _mean_above(sticking_speed, speed, speed_variance)
    found = np.einsum('mh,mhn->mn', weight, density * flux)
    other = outliers / (_RANGE * seen.approach[:, None])
    return np.asarray(np.log((1.0 - outliers) * found + other).sum(axis=0))


def _mean_above(
    least: float, mean: NDArray[np.float64], variance: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Integral of x over a Gaussian density of x from the least x up; never quite 0."""
    spread = np.sqrt(variance) + _TINY
    ratio = (mean - least) / spread
    density = np.exp(-0.5 * np.minimum(ratio**2, 1e3)) / _SQRT_2_PI
    return np.asarray(mean * ndtr(ratio) + spread * density) + _TINY


def _check_share(outliers: float) -> None:
    if not 0.0 < outliers < 1.0:
        raise FitError('outliers', f'a share of {outliers!r}', 'give one between 0 and 1')
