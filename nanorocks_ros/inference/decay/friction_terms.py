"""Terms of a decay library for beads that rub: what friction adds to the ln f of smooth ones.

Floor, lid and side walls have one coefficient of friction, beads another. Beads that slide along
floor and lid lose speed at a rate proportional to friction and to the vertical speeds, so that
ln f gets a further term -ln(1 + rubbing x / (1 + rate x)) with a rough rate, and polynomials that
vanish without friction.

Tested by ``test/inference/decay/test_friction_terms.py``.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Coefficient of friction of all walls; logarithm of that of the beads over it; tangential
# restitution less `TANGENTIAL`.
FRICTION = ('wall_friction', 'bead_friction', 'tangential')
HIGHEST_FRICTION, TANGENTIAL = 0.15, 0.4
# Units of the first and the last in the polynomials.
_WALL, _TANGENTIAL = 0.05, 0.3
# Largest degree of the losses with each power of the friction of the walls.
_DEGREES = (3, 2, 1)
_MOST_OF_SIDES = 1


def rubbing_rate(tray: Tray) -> float:
    """Approximate decay rate of a gas with a friction of 1 at floor and lid, [1/m].

    Half of that of an isotropic gas, since vertical speeds fall first.
    """
    depth = max(tray.dimensions[2] - tray.diameter, 0.1 * tray.diameter)
    return 0.6 / depth


def friction_terms(
    losses: NDArray[np.float64], nuisances: NDArray[np.float64], friction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Polynomials that vanish without friction.

    Parameters
    ----------
    losses : ndarray (n, 3)
        1 - restitution^2 of pairs, side walls, floor and lid.
    nuisances : ndarray (n, n_z)
        In the units of the library.
    friction : ndarray (n, 3)
        See `FRICTION`.

    Returns
    -------
    ndarray (n, n_terms)
    """
    pair, side = losses[:, 0], losses[:, 1]
    root = np.sqrt(np.maximum(losses[:, 2], 0.0))
    wall, beads, tangential = friction.T / np.array([[_WALL], [1.0], [_TANGENTIAL]])
    terms = [
        wall**power * pair**i * side**j * root**k
        for power, degree in enumerate(_DEGREES, 1)
        for i, j, k in product(range(degree + 1), range(_MOST_OF_SIDES + 1), range(degree + 1))
        if i + j + k <= degree
    ]
    terms += [wall * beads * factor for factor in (1.0, pair, root, beads, wall)]
    terms += [wall * tangential * factor for factor in (1.0, root, wall)]
    terms += [wall * values * factor for values in nuisances.T for factor in (1.0, root)]
    return np.column_stack(terms)


def friction_term_count(nuisances: int) -> int:
    """Number of coefficients of friction at each distance, plain and weighted."""
    ones = np.ones((1, 3))
    return 2 * int(friction_terms(ones, np.ones((1, nuisances)), ones).shape[1])
