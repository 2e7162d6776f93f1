"""Random non-overlapping positions of beads in a box."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.counter_rng import hashed
from nanorocks_ros.numerics.stable_sort import stable_argsort
from nanorocks_ros.simulation.packing.cell_list import Packing, new_packing
from nanorocks_ros.simulation.packing.grow_while_moving import grow_while_moving
from nanorocks_ros.simulation.packing.monte_carlo import insert_at_random

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

# Places tried for one bead before those left over enter small and grow. The fullest tray that
# was flown (0.29) needs 231 in thirty runs; 10^5 alike beads that fill 0.26, 744.
MOST_TRIES = 10_000

# Counters below this are for random places.
_GROWTH = 1 << 62

_SPHERE = 4.0 / 3.0 * math.pi


def random_positions(
    radii: ArrayLike,
    sides: Sequence[float],
    *,
    periodic: bool | Sequence[bool] = False,
    key: np.uint64,
) -> NDArray[np.float64]:
    """Random positions of beads in a box, see `pack_beads`.

    Parameters
    ----------
    radii : array_like (n,), [m], > 0
    sides : sequence of 3 floats, [m], > 0
        Of the box, one corner of which is the origin.
    periodic : bool or sequence of 3 bools
        Axes along which the box repeats itself, in place of walls.
    key : uint64
        Of `counter_rng.key_for`.

    Returns
    -------
    positions : ndarray (n, 3), [m]

    Raises
    ------
    SimulationError
        For an invalid radius or side, or when the beads do not fit.
    """
    sizes = _positive('radii', radii, None)
    box = _positive('box', sides, 3)
    around = _three_flags(periodic)
    _check_room(sizes, box)
    positions, placed = pack_beads(sizes, box, around, key, MOST_TRIES)
    if placed < sizes.size:
        raise SimulationError(
            'beads',
            f'found room for only {placed} of {sizes.size} beads, '
            f'which fill {_filling(sizes, box):.3g} of the box',
            'give fewer or smaller beads, or a larger box',
        )
    return positions


def _positive(name: str, values: ArrayLike, size: int | None) -> NDArray[np.float64]:
    """A copy of an array of lengths; refused unless finite and positive."""
    try:
        array = np.array(values, dtype=np.float64, order='C')
    except (TypeError, ValueError) as error:
        raise SimulationError(name, 'not an array of numbers', 'give lengths in metres') from error
    if array.ndim != 1 or array.size < 1 or array.size != (size or array.size):
        expected = 'one for each bead' if size is None else f'({size},)'
        raise SimulationError(name, f'shape {array.shape}, expected {expected}', 'correct it')
    wrong = np.flatnonzero(~(np.isfinite(array) & (array > 0.0)))
    if wrong.size:
        first = int(wrong[0])
        raise SimulationError(
            name,
            f'number {first} is {float(array[first])!r}',
            'give finite lengths above 0, in metres',
        )
    return array


def _three_flags(periodic: bool | Sequence[bool]) -> NDArray[np.bool_]:
    flags = np.asarray(periodic)
    if flags.dtype != np.bool_ or flags.shape not in {(), (3,)}:
        raise SimulationError('periodic', f'{periodic!r}', 'give True or False, or three of them')
    return np.array(np.broadcast_to(flags, (3,)))


def _check_room(radii: NDArray[np.float64], box: NDArray[np.float64]) -> None:
    largest, shortest = 2.0 * float(radii.max()), float(box.min())
    if largest >= shortest:
        raise SimulationError(
            'beads',
            f'diameter {largest:.6g} m in a box {shortest:.6g} m wide',
            'give smaller beads or a larger box',
        )
    filling = _filling(radii, box)
    if filling >= 1.0:
        raise SimulationError(
            'beads', f'fill {filling:.3g} of the box', 'give fewer beads or a larger box'
        )


def _filling(radii: NDArray[np.float64], box: NDArray[np.float64]) -> float:
    return float(_SPHERE * math.fsum((radii**3).tolist()) / math.prod(box.tolist()))


@compiled
def pack_beads(
    radii: NDArray[np.float64],
    sides: NDArray[np.float64],
    periodic: NDArray[np.bool_],
    key: np.uint64,
    most_tries: int,
) -> tuple[NDArray[np.float64], int]:
    """Place beads at random in a box, without overlap.

    One after the other, the largest first, each at the first random place that is clear of
    those before. When one fails, `grow_while_moving` packs them.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    sides : ndarray (3,), [m]
    periodic : ndarray of bool, (3,)
        Axes without walls. There, centres are in [0, side) and distances are those of the
        nearest images; elsewhere, beads are clear of both walls.
    key : uint64
    most_tries : int
        For one bead, before `grow_while_moving`.

    Returns
    -------
    positions : ndarray (n, 3), [m]
    placed : int
        Beads that were placed. When fewer than n, these are the largest, equal ones from the
        last; the others have no valid position.
    """
    n = radii.size
    for i in range(n):
        for axis in range(3):
            if not (radii[i] > 0.0 and 2.0 * radii[i] < sides[axis]):
                return np.zeros((n, 3)), 0
    packing = _packing(radii, sides, periodic)
    placed = insert_at_random(packing, 0, key, most_tries, 0)
    if placed < n and grow_while_moving(packing, placed, hashed(key, _GROWTH)):
        placed = n
    return packing.positions, placed


@compiled
def _packing(
    radii: NDArray[np.float64],
    sides: NDArray[np.float64],
    periodic: NDArray[np.bool_],
) -> Packing:
    """A packing of copies in fixed types, so that it is compiled once."""
    box = np.empty(3)
    around = np.empty(3, dtype=np.bool_)
    for axis in range(3):
        box[axis] = sides[axis]
        around[axis] = periodic[axis]
    return new_packing(radii.copy(), box, around, stable_argsort(radii))
