"""Probability that two free beads stay side by side by chance.

A camera sees beads in projection: any two may pass or touch, and some do so slowly. A body of two
beads stays together while free beads of that gas would have separated.
Derived in docs/method/clusters.md.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.experiment.trays import Tray

# A relative velocity u, Gaussian in two components, stays within a box of full width 2 x over a
# time T when |u_i| T < 2 x, so that u T lies in an area of 16 x^2.
_BOX_AREA = 16.0
# Slow pairs are more frequent than a Gaussian says: inelastic neighbours move alike, and mixtures
# and starts with even speeds are peaked. Together with the next number it is not below what gases
# without sticking show, restitutions 0.5 to 0.95 (`python -m benchmarks sticking`).
_PEAKED = 7.0
# Where beads cover more of the floor, those around a pair keep it together: shares of the floor,
# and two ways in which others part a pair there.
_COVERED = 0.25, 0.30
# Collisions that part two neighbours, with each other and with others, per encounter of a bead
# and relative path: 2 in simulated trays 3, 1 in trays 5.
_DISTURBED = 1.3, 0.85
# Collisions that part two neighbours whose distance may vary, per collision of either bead; others
# leave them beside each other: 0.85 in gases of free beads in tray 3.
_PARTING = 0.75, 0.4
# Heights of the centres of two beads, for mean widths: nodes of a midpoint rule.
_HEIGHTS = (np.arange(32) + 0.5) / 32
# Radii at which collision rates are worked out.
_RADII = 16
# Nearest over farthest distance in the image of two beads that turn together, as a rule.
_TURNING = 0.7
# Part of the pairs of beads that are known as bodies within the path of a first merge.
_MOST = 0.9
# Longest path that is searched for it, [m].
_LONGEST = 1.0
# Way of a bead between two shaking events, [m]: 58 s after a shake at 10 mm/s it was 0.03 to 0.12.
_CYCLE = 0.1


def encounter_rate(tray: Tray) -> float:
    """Encounters of a bead with others in the image per path length, [1/m].

    Discs that move at random over the floor; passing above counts as much as a collision.
    """
    radii = 0.5 * np.array([species.diameter for species in tray.species])
    counts = np.array([species.count for species in tray.species], dtype=np.float64)
    reach = (counts @ (radii[:, None] + radii) @ counts) / counts.sum() ** 2
    room = math.prod(side - tray.diameter for side in tray.dimensions[:2])
    return float(2.0 * math.sqrt(2.0) * reach * max(counts.sum() - 1.0, 0.0) / room)


def parting_rate(tray: Tray) -> float:
    """Encounters that part two neighbours whose separation is constant, per path, [1/m]."""
    return float(np.interp(_covered_share(tray), _COVERED, _DISTURBED)) * encounter_rate(tray)


def chance_probability(
    path: ArrayLike, tolerance: ArrayLike, rate: float, collision_path: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Probability that an encounter of two free beads looks like a body of two.

    Parameters
    ----------
    path : array_like, [m]
        Standard deviation of a component of their relative velocity, summed over the time in
        which they stayed beside each other.
    tolerance : array_like, [m]
        Half of the range within which a component of their separation stayed.
    rate : float, [1/m]
        From `parting_rate`.
    collision_path : array_like, [m], optional
        The path on which others may hit them, at the speed of the gas at each time; as `path` when
        not given. A free pair keeps the speed it met with, though the gas around it cools.

    Returns
    -------
    ndarray, 0 to 1
    """
    area = _BOX_AREA * np.square(tolerance)
    return _chance(path, area, rate, path if collision_path is None else collision_path)


class CollisionRate:
    """Collisions of two neighbours with other beads, per path of their relative motion.

    In the plane: a bead meets those whose height lets them touch.

    Parameters
    ----------
    tray : Tray
    """

    def __init__(self, tray: Tray) -> None:
        species = [kind for kind in tray.species if kind.count]
        sizes = [
            0.5 * size for kind in species for size in (kind.diameter_low, kind.diameter_high)
        ]
        self._radii = np.linspace(min(sizes), max(sizes), _RADII)
        room = math.prod(side - tray.diameter for side in tray.dimensions[:2])
        height, others = tray.dimensions[2], max(1.0 - 1.0 / tray.count, 0.0)
        widths = [
            kind.count * _mean_width(self._radii, 0.5 * kind.diameter, height) for kind in species
        ]
        # The mean relative speed in the plane is (pi/2)^(1/2) times a component.
        self._rates = math.sqrt(0.5 * math.pi) * others * np.sum(widths, axis=0) / room

    def __call__(
        self, radii: NDArray[np.float64], deflected: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Collisions per path, [1/m].

        Parameters
        ----------
        radii : ndarray (n,), [m]
            Of the smaller bead of each pair.
        deflected : ndarray (n,), 1 to 2
            Beads of a pair whose collisions change its relative velocity: a heavy bead is hardly
            deflected.
        """
        return np.asarray(deflected * np.interp(radii, self._radii, self._rates))


def parting_share(tray: Tray) -> float:
    """Share of the collisions of two neighbours that part them, while their distance may vary."""
    return float(np.interp(_covered_share(tray), _COVERED, _PARTING))


def _covered_share(tray: Tray) -> float:
    """Share of the floor that beads cover."""
    radii = np.array([0.5 * species.diameter for species in tray.species])
    counts = np.array([species.count for species in tray.species], dtype=np.float64)
    return math.pi * float(counts @ radii**2) / math.prod(tray.dimensions[:2])


def _mean_width(radii: NDArray[np.float64], radius: float, height: float) -> NDArray[np.float64]:
    """Mean width within which beads of some radii, (n,), hit one of another radius, [m]."""
    own = (
        radii[:, None, None]
        + np.maximum(height - 2.0 * radii, 0.0)[:, None, None] * (_HEIGHTS[:, None])
    )
    other = radius + max(height - 2.0 * radius, 0.0) * _HEIGHTS
    squares = (radii[:, None, None] + radius) ** 2 - (own - other) ** 2
    return np.asarray(2.0 * np.sqrt(np.maximum(squares, 0.0)).mean(axis=(1, 2)))


def turning_chance_probability(
    path: ArrayLike, nearest: ArrayLike, farthest: ArrayLike, parting_rate: ArrayLike
) -> NDArray[np.float64]:
    """Probability that an encounter of two free beads looks like a body of two that turns.

    Free beads move past each other on a straight line. Such a line stays between the distances
    a and b for 2 (b^2 - a^2)^(1/2) at most, and only if it has the direction of the tangent
    within (b - a): the displacement lies in an area of about 4 (b - a) (b^2 - a^2)^(1/2), for
    a = 0 in that of the disc.

    Parameters
    ----------
    path : array_like, [m]
        As in `chance_probability`.
    nearest, farthest : array_like, [m]
        Range of their distance in the image.
    parting_rate : array_like, [1/m]
        From `CollisionRate`, times `parting_share`.

    Returns
    -------
    ndarray, 0 to 1
    """
    a, b = np.asarray(nearest, dtype=np.float64), np.asarray(farthest, dtype=np.float64)
    area = 4.0 * (b - a) * np.sqrt(b**2 - a**2)
    return _chance(path, area, parting_rate, path)


def _chance(
    path: ArrayLike, area: NDArray[np.float64], rate: ArrayLike, collision_path: ArrayLike
) -> NDArray[np.float64]:
    """Probability that the displacement of free beads lies in an area, and nothing parts them.

    The displacement is Gaussian with the path W as the standard deviation of each component; its
    density at 0 is 1 / (2 pi W^2). They are parted at a rate per path, of collisions.
    """
    path_length = np.asarray(path, dtype=np.float64)
    slow = _PEAKED * area / (2.0 * math.pi * np.maximum(path_length, 1e-12) ** 2)
    return np.asarray(np.minimum(1.0, slow) * np.exp(-np.asarray(rate) * collision_path))


def expected_encounters(tray: Tray) -> float:
    """Encounters of all beads between two shaking events, each pair's once."""
    return 0.5 * tray.count * encounter_rate(tray) * _CYCLE


def max_chance_probability(tray: Tray, false_alarm_rate: float) -> float:
    """Largest chance probability of a body, at a rate of false alarms per cycle.

    Parameters
    ----------
    tray : Tray
    false_alarm_rate : float, 0 to 1
        Fraction of cycles without sticking in which a body is reported.

    Raises
    ------
    ConfigurationError
        When the rate is not between 0 and 1.
    """
    if not 0.0 < false_alarm_rate < 1.0:
        raise ConfigurationError(
            'bodies.false_alarm_rate', f'{false_alarm_rate!r}', 'give a rate between 0 and 1'
        )
    return false_alarm_rate / max(expected_encounters(tray), 1.0)


def first_merge_path(tray: Tray, false_alarm_rate: float) -> float:
    """Path of the beads, at their mean projected speed, in which a first merge becomes known.

    That of two beads that turn together, at energies that are the same for all: a merge that comes
    later is not seen by the end. Later merges of a cycle need less.

    Parameters
    ----------
    tray : Tray
    false_alarm_rate : float, 0 to 1
        As of `max_chance_probability`.

    Returns
    -------
    float, [m]
    """
    kinds = [kind for kind in tray.species if kind.count]
    radii = 0.5 * np.array([kind.diameter for kind in kinds])
    counts = np.array([kind.count for kind in kinds], dtype=np.float64)
    variances = 1.0 / np.array([kind.bead_mass for kind in kinds])
    mean_speed = math.sqrt(0.5 * math.pi) * float(counts @ np.sqrt(variances)) / counts.sum()
    i, j = np.triu_indices(len(kinds))
    pairs = np.where(i == j, 0.5 * counts[i] * (counts[i] - 1.0), counts[i] * counts[j])
    low, high = (pick(variances[i], variances[j]) for pick in (np.minimum, np.maximum))
    collisions = CollisionRate(tray)(np.minimum(radii[i], radii[j]), 1.0 + low / high)
    # Relative paths, on a grid that is fine enough.
    paths = np.geomspace(1e-4, _LONGEST, 2000)
    chances = turning_chance_probability(
        paths,
        _TURNING * (radii[i] + radii[j])[:, np.newaxis],
        (radii[i] + radii[j])[:, np.newaxis],
        (parting_share(tray) * collisions)[:, np.newaxis],
    )
    is_known = chances < max_chance_probability(tray, false_alarm_rate)
    known = np.where(is_known.any(axis=1), paths[is_known.argmax(axis=1)], _LONGEST)
    needed = known * mean_speed / np.sqrt(variances[i] + variances[j])
    order = np.argsort(needed)
    shares = np.cumsum(pairs[order]) / max(pairs.sum(), 1.0)
    return float(needed[order][min(np.searchsorted(shares, _MOST), needed.size - 1)])
