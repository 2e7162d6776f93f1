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
# time T when |u_i| T < 2 x: 16 x^2 / (2 pi W^2), W being the path sigma T of a component.
_BOX = 8.0 / math.pi
# Slow pairs are more frequent than a Gaussian says: inelastic neighbours move alike, and mixtures
# and starts with even speeds are peaked. Together with the next number it is not below what gases
# without sticking show, restitutions 0.5 to 0.95 (`python -m benchmarks sticking`).
_PEAKED = 7.0
# Collisions that part two neighbours, with each other and with others, per encounter of a bead
# and relative path: 2 in simulated trays 3, 1 in trays 5.
_DISTURBED = 1.3
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


def chance_probability(path: ArrayLike, tolerance: ArrayLike, rate: float) -> NDArray[np.float64]:
    """Probability that an encounter of two free beads looks like a body of two.

    Parameters
    ----------
    path : array_like, [m]
        Standard deviation of a component of their relative velocity, summed over the time in
        which they stayed beside each other.
    tolerance : array_like, [m]
        Half of the range within which a component of their separation stayed.
    rate : float, [1/m]
        From `encounter_rate`.

    Returns
    -------
    ndarray, 0 to 1
    """
    path_length = np.asarray(path, dtype=np.float64)
    ratio = np.asarray(tolerance, dtype=np.float64) / np.maximum(path_length, 1e-12)
    slow = np.minimum(1.0, _PEAKED * _BOX * ratio**2)
    return np.asarray(slow * np.exp(-_DISTURBED * rate * path_length))


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
