"""Checks of the input of the engine; every error names the value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.numerics.compiled import kernel
from nanorocks_ros.simulation.engine.flight.pair_times import minimum_image
from nanorocks_ros.simulation.engine.gas_state import ORIGINAL, RADIUS, State, X, Y, Z
from nanorocks_ros.simulation.engine.integer_width import as_int64

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# Certainly too full; whether fewer find room, their placement tells.
_FULL = 1.0
# The engine itself keeps gaps above -4e-11 of a length of order 1.
OVERLAP = 1e-9
# Numbers of beads are kept in 32 bits, and a place in a queue needs room.
_MOST_BEADS = 100_000_000
_MOST_SPECIES = 1000


def check_beads(
    radii: ArrayLike,
    masses: ArrayLike,
    positions: ArrayLike,
    velocities: ArrayLike,
    rules: Rules,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Copies of the arrays, refused when invalid; overlap is checked elsewhere."""
    r = _finite('radii', radii, (None,))
    n = r.size
    if not 1 <= n <= _MOST_BEADS:
        raise SimulationError('beads', f'{n} of them', f'give 1 to {_MOST_BEADS}')
    m = _finite('masses', masses, (n,))
    x = _finite('positions', positions, (n, 3))
    v = _finite('velocities', velocities, (n, 3))
    for name, values in (('radii', r), ('masses', m)):
        if values.min() <= 0.0:
            worst = int(values.argmin())
            raise SimulationError(
                name, f'bead {worst} has {float(values[worst])!r}', 'give positive values'
            )
    check_room(r, rules)
    _check_inside(r, x, rules)
    return r, m, x, v


def check_species(species: ArrayLike | None, n: int, known: int) -> NDArray[np.int32]:
    """Species of each bead, refused when the restitution has no entry for one.

    Parameters
    ----------
    species : array_like of int, (n,), or None
        None: all of the first.
    n : int
    known : int
        How many species the restitution tells apart; 1: any number may be given.
    """
    if species is None:
        return np.zeros(n, dtype=np.int32)
    numbers = np.asarray(species)
    if numbers.shape != (n,) or numbers.dtype.kind not in 'iu':
        raise SimulationError(
            'species',
            f'shape {numbers.shape} of {numbers.dtype}',
            'give one whole number for each bead',
        )
    n_species = known if known > 1 else _MOST_SPECIES
    wrong = (numbers < 0) | (numbers >= n_species)
    if wrong.any():
        worst = int(wrong.argmax())
        raise SimulationError(
            'species',
            f'bead {worst} is of the unknown species {int(numbers[worst])}',
            f'give numbers from 0 to {n_species - 1}, or a restitution for it',
        )
    return numbers.astype(np.int32)


def check_spins(spins: ArrayLike | None, n: int, rough: bool) -> NDArray[np.float64]:
    """Spins of each bead, refused for smooth beads."""
    if spins is None:
        return np.zeros((n if rough else 0, 3))
    numbers = _finite('spins', spins, (n, 3))
    if not rough:
        raise SimulationError(
            'spins', 'given for smooth beads', 'give a tangential_restitution, or no spins'
        )
    return numbers


def check_drag(drag: ArrayLike | None, n: int) -> NDArray[np.float64]:
    """Decay rates of each bead and of its body, (n, 2); (0,) where none is above 0."""
    if drag is None:
        return np.zeros(0)
    rates = _finite('drag', drag, (n,))
    if rates.min() < 0.0:
        worst = int(rates.argmin())
        raise SimulationError(
            'drag', f'bead {worst} has {float(rates[worst])!r} 1/s', 'give 0 or more'
        )
    if not rates.any():
        return np.zeros(0)
    return np.stack((rates, rates), axis=1)


def check_room(radii: NDArray[np.float64], rules: Rules) -> None:
    """Refuse beads that are larger than the box or fill more than its volume.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    rules : Rules

    Raises
    ------
    SimulationError
        When they cannot fit.
    """
    largest = 2.0 * float(radii.max())
    for axis, side in enumerate(rules.sides):
        # With periodic sides a bead must not meet two images of another at once.
        least = 2.0 * largest if rules.periodic[axis] else largest
        if least >= side:
            raise SimulationError(
                'beads',
                f'diameter {largest:.6g} m in a box {side:.6g} m wide',
                'give smaller beads or a larger box',
            )
    volume = math.prod(rules.sides)
    filling = 4.0 / 3.0 * math.pi * math.fsum((radii * radii * radii).tolist()) / volume
    if filling >= _FULL:
        raise SimulationError(
            'beads', f'fill {filling:.3g} of the box', 'give fewer beads or a larger box'
        )


def check_times(
    now: float, end: float, times: ArrayLike, name: str = 'frame_times'
) -> NDArray[np.float64]:
    """Times as an array, refused when they do not rise from `now` to `end`."""
    checked = _finite(name, times, (None,))
    if not (math.isfinite(end) and end >= now):
        raise SimulationError('end', f'{end!r} s, already at {now!r} s', 'give a later time')
    if checked.size and (
        checked[0] < now or checked[-1] > end or np.any(checked[1:] < checked[:-1])
    ):
        raise SimulationError(
            name,
            f'not rising from {now!r} s to {end!r} s',
            'sort them and keep them in this range',
        )
    return checked


def _finite(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    try:
        array = np.array(values, dtype=np.float64, order='C')
    except (TypeError, ValueError) as error:
        raise SimulationError(name, 'not an array of numbers', 'give numbers') from error
    expected = tuple(
        array.shape[k] if side is None and k < array.ndim else side for k, side in enumerate(shape)
    )
    if array.shape != expected:
        raise SimulationError(
            name, f'shape {array.shape}, expected {shape}', 'one row for each bead'
        )
    if not np.isfinite(array).all():
        first_bad = np.argwhere(~np.isfinite(array))[0].tolist()
        raise SimulationError(
            name, f'{float(array[tuple(first_bad)])!r} at {first_bad}', 'give finite values'
        )
    return array


def _check_inside(radii: NDArray[np.float64], x: NDArray[np.float64], rules: Rules) -> None:
    walls = ~np.array(rules.periodic)
    depth = np.maximum(radii[:, np.newaxis] - x, x + radii[:, np.newaxis] - np.array(rules.sides))
    deepest = np.where(walls, depth, -np.inf).max(axis=1)
    outside = int(deepest.argmax())
    if deepest[outside] > OVERLAP * radii[outside]:
        raise SimulationError(
            'positions',
            f'bead {outside} reaches {deepest[outside]:.3g} m into a wall',
            'place beads inside the box',
        )


def refuse_overlap(i: int, j: int) -> None:
    """Refuse a pair of beads that overlaps (-1: none)."""
    if i >= 0:
        i, j = min(i, j), max(i, j)
        raise SimulationError('positions', f'beads {i} and {j} overlap', 'place them apart')


@kernel
def overlapping_pair(state: State, rules: Rules) -> tuple[int, int]:
    """First pair of beads that overlaps by more than rounding, by original number, or (-1, -1)."""
    rows = state.rows
    listed = state.references.shape[0] > 0
    for i in range(rows.shape[0]):
        n_partners = as_int64(state.neighbours[i, 0]) if listed else rows.shape[0] - i - 1
        for k in range(n_partners):
            j = as_int64(state.neighbours[i, k + 1]) if listed else i + 1 + k
            dx = minimum_image(rules, 0, rows[j, X] - rows[i, X])
            dy = minimum_image(rules, 1, rows[j, Y] - rows[i, Y])
            dz = minimum_image(rules, 2, rows[j, Z] - rows[i, Z])
            reach = (rows[i, RADIUS] + rows[j, RADIUS]) * (1.0 - OVERLAP)
            if dx * dx + dy * dy + dz * dz < reach * reach:
                return as_int64(state.links[i, ORIGINAL]), as_int64(state.links[j, ORIGINAL])
    return -1, -1
