"""Contact rates of beads in a narrow box, with each other and with the walls, by geometry.

Beads of a gas without losses are spread evenly over all arrangements in which none overlap. Two
beads thrown into the box at random touch along a direction k with the density

    p_ab(k) = product over x, y, z of l_i(d_ab k_i) / (H_ai H_bi),
    l_i(r) = min(H_ai, H_bi, (H_ai + H_bi)/2 - |r|) or 0,      H_ai = L_i - d_a,

exactly. The other beads increase the rate, because beads that touch leave more room to the rest:
to first order in the density by 1 + x_ab, where x_ab is the decrease of the volume excluded to the
others when the pair touches, averaged over the box. Both are computed numerically, with the walls.
Higher orders are those of Carnahan and Starling's spheres at the density with the same first
order. Contacts with a wall increase because neighbours push beads against it: by 1 + the first
order times the contact value, like the pressure of a fluid. In a wide box this is Enskog's
theory.

Tested by ``test/physics/test_confined_theory.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.physics.kinetic_theory import contact_value

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Number of points of the integrals over the box: collision rates are accurate to 0.5 %.
_POINTS = 4096
# Number of directions in an octant, along z and around it.
_NODES = 12
# First order of the contact value of spheres in the filling factor.
_SPHERES = 2.5
# Above these values the first order is not accurate.
_MOST_FILLING = 0.4
_MOST_AT_WALLS = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BeadClasses:
    """Beads of a tray by size; those of a class are equal.

    Parameters
    ----------
    counts : ndarray (n,)
        Not whole numbers if a range of diameters is represented by a few.
    diameters, masses : ndarray (n,), [m], [kg]
    species : ndarray of int, (n,)
        Index in `Tray.species`.
    """

    counts: NDArray[np.float64]
    diameters: NDArray[np.float64]
    masses: NDArray[np.float64]
    species: NDArray[np.int64]


def bead_classes(tray: Tray, sizes: int = 3) -> BeadClasses:
    """Classes of the beads of a tray; a range of diameters by Gauss-Legendre nodes.

    Parameters
    ----------
    tray : Tray
    sizes : int, > 0
    """
    nodes, weights = np.polynomial.legendre.leggauss(sizes)
    rows = []
    for place, species in enumerate(tray.species):
        half = 0.5 * (species.diameter_high - species.diameter_low)
        quadrature = zip(nodes, 0.5 * weights, strict=True) if half > 0.0 else ((0.0, 1.0),)
        for node, weight in quadrature:
            diameter = species.diameter + half * node
            mass = species.density * math.pi / 6.0 * diameter**3
            rows.append((species.count * weight, diameter, mass, place))
    counts, diameters, masses, species_index = np.array(rows).T
    return BeadClasses(
        counts=counts, diameters=diameters, masses=masses, species=species_index.astype(np.int64)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Contacts:
    """Contact rates of bead classes in a box.

    Parameters
    ----------
    pairs : ndarray (n, n, n_directions), [1/m]
        Times the mean approach speed along the direction: collisions per second of one bead of
        class a with those of class b. Weights of a sum over directions.
    squares : ndarray (n, n, n_directions, 3)
        Squares of the components of the directions of `pairs`.
    walls : ndarray (n, 3), [1/m]
        Times the mean of |v_i|: collisions per second of one bead with the two walls across
        axis i.
    """

    pairs: NDArray[np.float64]
    squares: NDArray[np.float64]
    walls: NDArray[np.float64]


def contacts(beads: BeadClasses, dimensions: tuple[float, float, float]) -> Contacts:
    """Contact rates in a box.

    Parameters
    ----------
    beads : BeadClasses
    dimensions : tuple of 3 floats, [m]

    Raises
    ------
    ConfigurationError
        When a bead is no smaller than the box, or the box is too crowded for the theory.
    """
    room = np.array(dimensions) - beads.diameters[:, np.newaxis]
    if not (room > 0.0).all():
        raise ConfigurationError(
            'confined theory', 'a bead fills the height of its box', 'give beads that can move'
        )
    touch = 0.5 * (beads.diameters[:, np.newaxis] + beads.diameters)
    overlaps = _overlaps(room, touch)
    crowded = _pair_crowding(beads, room, touch, overlaps)
    walls = _wall_crowding(beads, room, touch, overlaps)
    filling = crowded / _SPHERES
    if filling.max() > _MOST_FILLING or walls.sum(axis=1).max() > _MOST_AT_WALLS:
        raise ConfigurationError(
            'confined theory',
            f'beads are as crowded as in a fluid of filling factor {filling.max():.2f}, and at '
            f'walls {walls.sum(axis=1).max():.2f} more frequent to first order',
            f'it is good up to {_MOST_FILLING} and {_MOST_AT_WALLS}: use the decay library',
        )
    partners = beads.counts - np.eye(beads.counts.size)
    rates, squares = _directions(room, touch)
    crowding = np.vectorize(contact_value)(filling)
    pairs = np.maximum(partners * crowding, 0.0)[..., np.newaxis] * rates
    at_walls = 1.0 + (crowding[..., np.newaxis] * walls).sum(axis=1)
    return Contacts(pairs=pairs, squares=squares, walls=at_walls / room)


def _shared(
    first: NDArray[np.float64], second: NDArray[np.float64], apart: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Length available to the first centre, with the second at a distance `apart`."""
    least = np.minimum(first, second)
    return np.clip(np.minimum(least, 0.5 * (first + second) - np.abs(apart)), 0.0, None)


def _spread(dimensions: int) -> NDArray[np.float64]:
    """Points spread evenly over a unit cube, (_POINTS, dimensions): an additive recurrence.

    References
    ----------
    Generalised golden ratios; Roberts 2018, The unreasonable effectiveness of quasirandom
    sequences.
    """
    ratio = 2.0
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))
    steps = ratio ** -np.arange(1.0, dimensions + 1.0)
    points: NDArray[np.float64] = (
        0.5 + np.arange(1.0, _POINTS + 1.0)[:, np.newaxis] * steps
    ) % 1.0
    return points


def _sphere(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions from points of a unit square, (n, 3)."""
    along = 2.0 * points[:, 0] - 1.0
    across = np.sqrt(1.0 - along**2)
    angle = 2.0 * math.pi * points[:, 1]
    return np.stack((across * np.cos(angle), across * np.sin(angle), along), axis=-1)


def _ball(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of a unit ball from those of a unit cube, (n, 3)."""
    inside: NDArray[np.float64] = np.cbrt(points[:, 2:3]) * _sphere(points)
    return inside


def _volume(radius: float) -> float:
    return 4.0 / 3.0 * math.pi * radius**3


def _overlaps(room: NDArray[np.float64], touch: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probability that two beads at random positions in the box overlap, (n, n)."""
    places = _ball(_spread(3))
    probability = np.empty_like(touch)
    for a, b in np.ndindex(touch.shape):
        shared = _shared(room[a], room[b], touch[a, b] * places).prod(axis=1)
        probability[a, b] = (
            _volume(float(touch[a, b])) * shared.mean() / (room[a].prod() * room[b].prod())
        )
    return probability


def _wall_crowding(
    beads: BeadClasses,
    room: NDArray[np.float64],
    touch: NDArray[np.float64],
    overlaps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Relative increase of wall contacts to first order in the density, (n, n, 3).

    For each class, the part of each other class, at the walls across each axis.
    """
    places = _ball(_spread(3))
    crowding = np.zeros((*touch.shape, 3))
    for a, c in np.ndindex(touch.shape):
        apart = touch[a, c] * places
        shared = _shared(room[a], room[c], apart)
        for axis in range(3):
            inside = np.abs(apart[:, axis] - 0.5 * room[a, axis]) <= 0.5 * room[c, axis]
            rest = np.delete(shared, axis, axis=1).prod(axis=1)
            area = np.delete(room[a], axis).prod()
            at_wall = (
                _volume(float(touch[a, c])) * (inside * rest).mean() / (room[c].prod() * area)
            )
            crowding[a, c, axis] = (beads.counts[c] - (a == c)) * (overlaps[a, c] - at_wall)
    return crowding


def _pair_crowding(
    beads: BeadClasses,
    room: NDArray[np.float64],
    touch: NDArray[np.float64],
    overlaps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Relative increase of contacts of two beads to first order in the density, (n, n)."""
    points = _spread(5)
    # Rows of coordinates: numpy multiplies whole rows, but takes each point by itself.
    directions = np.ascontiguousarray(_sphere(points).T)
    third = np.ascontiguousarray(_ball(points[:, [3, 4, 2]]).T)
    crowding = np.array(overlaps)
    for a, b in np.ndindex(touch.shape):
        apart = touch[a, b] * directions
        weight = _product(_shared(_column(room[a]), _column(room[b]), apart)).mean()
        for c in range(beads.counts.size):
            others = beads.counts[c] - (a == c) - (b == c)
            if others <= 0.0:
                continue
            volume = _kept_off(room[[a, b, c]], apart, third, (touch[a, c], touch[b, c]))
            volume += _kept_off(room[[b, a, c]], -apart, third, (touch[b, c], touch[a, c]))
            kept = volume / (weight * room[c].prod())
            crowding[a, b] += others * (overlaps[a, c] + overlaps[b, c] - kept)
    return crowding


def _column(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values[:, np.newaxis]


def _product(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product of three rows, place by place."""
    return np.asarray(rows[0] * rows[1] * rows[2])


def _kept_off(
    rooms: NDArray[np.float64],
    apart: NDArray[np.float64],
    third: NDArray[np.float64],
    reach: tuple[float, float],
) -> float:
    """Mean volume excluded to a third bead by one of a pair; overlap is shared with the partner.

    Parameters
    ----------
    rooms : ndarray (3, 3), [m]
        Of the bead, its partner and the third.
    apart, third : ndarray (3, n), [m], [1]
        Position of the partner relative to the bead, and of the third in units of the contact
        distance.
    reach : tuple of 2 floats, [m]
        Contact distances of the third with the bead and with its partner.
    """
    offset = reach[0] * third
    half = 0.5 * rooms[..., np.newaxis]
    low = np.maximum(np.maximum(-half[0], -half[1] - apart), -half[2] - offset)
    high = np.minimum(np.minimum(half[0], half[1] - apart), half[2] - offset)
    places = _product(np.clip(high - low, 0.0, None))
    squares = (offset - apart) ** 2
    shared = squares[0] + squares[1] + squares[2] < reach[1] ** 2
    return _volume(reach[0]) * float((places * (1.0 - 0.5 * shared)).mean())


def _directions(
    room: NDArray[np.float64], touch: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """d^2 p_ab(k) times the solid angle, (n, n, n_directions), and k_i^2, (n, n, ..., 3)."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    n = touch.shape[0]
    rates, squares = np.empty((n, n, _NODES**2)), np.empty((n, n, _NODES**2, 3))
    angle = np.tile(0.5 * math.pi * nodes, _NODES)
    for a, b in np.ndindex(touch.shape):
        steepest = min(1.0, 0.5 * (room[a, 2] + room[b, 2]) / touch[a, b])
        along = np.repeat(steepest * nodes, _NODES)
        across = np.sqrt(1.0 - along**2)
        k = np.stack((across * np.cos(angle), across * np.sin(angle), along), axis=-1)
        # Eight octants.
        solid = 8.0 * steepest * 0.5 * math.pi * np.outer(weights, weights).ravel()
        shared = _shared(room[a], room[b], touch[a, b] * k).prod(axis=1)
        density = shared / (room[a].prod() * room[b].prod())
        rates[a, b], squares[a, b] = touch[a, b] ** 2 * density * solid, k**2
    return rates, squares
