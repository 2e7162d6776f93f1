"""What the engine refuses at its door, with the value at fault."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from nanorocks_ros.simulation.engine.state import Rules

# Certainly too full; whether fewer find room, their placement tells.
_FULL = 1.0
# The engine itself keeps gaps above -4e-11 of a length of order 1.
_OVERLAP = 1e-9
# One contact time per pair is kept: 128 MB at this size.
_MOST_BEADS = 4000


def check_rules(rules: Rules) -> None:
    """Refuse a box or a restitution that cannot be."""
    for name in ('side_x', 'side_y', 'side_z'):
        side = getattr(rules, name)
        if not (math.isfinite(side) and side > 0.0):
            raise SimulationError('box', f'{name} is {side!r}', 'give positive sides in metres')
    for name in ('restitution', 'wall_restitution'):
        value = getattr(rules, name)
        if not 0.0 <= value <= 1.0:
            raise SimulationError(name, f'{value!r} is outside [0, 1]', 'give a value from 0 to 1')
    if not (math.isfinite(rules.contact_duration) and rules.contact_duration >= 0.0):
        raise SimulationError(
            'contact_duration', f'{rules.contact_duration!r}', 'give 0 or a positive time in s'
        )


def check_beads(
    radii: ArrayLike,
    masses: ArrayLike,
    positions: ArrayLike,
    velocities: ArrayLike,
    rules: Rules,
    *,
    overlap: bool = True,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Copies of the arrays, refused when no gas can be made of them."""
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
    if overlap:
        _check_places(r, x, rules)
    return r, m, x, v


def check_room(radii: NDArray[np.float64], rules: Rules) -> None:
    """Refuse beads larger than the box, or more of them than it holds.

    Parameters
    ----------
    radii : ndarray (n,), [m]
    rules : Rules

    Raises
    ------
    SimulationError
        When they cannot fit.
    """
    shortest = min(rules.side_x, rules.side_y, rules.side_z)
    largest = 2.0 * float(radii.max())
    if largest >= shortest:
        raise SimulationError(
            'beads',
            f'diameter {largest:.6g} m in a box {shortest:.6g} m wide',
            'give smaller beads or a larger box',
        )
    volume = rules.side_x * rules.side_y * rules.side_z
    filling = 4.0 / 3.0 * math.pi * math.fsum((radii * radii * radii).tolist()) / volume
    if filling >= _FULL:
        raise SimulationError(
            'beads', f'fill {filling:.3g} of the box', 'give fewer beads or a larger box'
        )


def check_times(now: float, end: float, frame_times: ArrayLike) -> NDArray[np.float64]:
    """Frame times as an array, refused when time would go backwards."""
    times = _finite('frame_times', frame_times, (None,))
    if not (math.isfinite(end) and end >= now):
        raise SimulationError('end', f'{end!r} s, already at {now!r} s', 'give a later time')
    if times.size and (times[0] < now or times[-1] > end or np.any(times[1:] < times[:-1])):
        raise SimulationError(
            'frame_times',
            f'not rising from {now!r} s to {end!r} s',
            'sort them and keep them in this range',
        )
    return times


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
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise SimulationError(
            name, f'{float(array[tuple(where)])!r} at {where}', 'give finite values'
        )
    return array


def _check_places(radii: NDArray[np.float64], x: NDArray[np.float64], rules: Rules) -> None:
    sides = np.array([rules.side_x, rules.side_y, rules.side_z])
    depth = np.maximum(radii[:, np.newaxis] - x, x + radii[:, np.newaxis] - sides)
    outside = int(depth.max(axis=1).argmax())
    if depth[outside].max() > _OVERLAP * radii[outside]:
        raise SimulationError(
            'positions',
            f'bead {outside} reaches {depth[outside].max():.3g} m into a wall',
            'place beads inside the box',
        )
    i, j = overlapping_pair(x, radii)
    if i >= 0:
        raise SimulationError('positions', f'beads {i} and {j} overlap', 'place them apart')


@compiled
def overlapping_pair(
    positions: NDArray[np.float64], radii: NDArray[np.float64]
) -> tuple[int, int]:
    """Two beads that overlap by more than rounding, or (-1, -1)."""
    for i in range(radii.size):
        for j in range(i + 1, radii.size):
            square = 0.0
            for axis in range(3):
                d = positions[j, axis] - positions[i, axis]
                square += d * d
            reach = (radii[i] + radii[j]) * (1.0 - _OVERLAP)
            if square < reach * reach:
                return i, j
    return -1, -1
