"""Hard spheres in a box that stick when slow and then turn as rigid bodies: truth for recognition.

It shares nothing with `nanorocks_ros.simulation`, whose bodies turn as well: time stepping, free
rigid bodies with momentum and angular momentum in three dimensions, drag and friction.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numba
import numpy as np

from nanorocks_ros.records import Tracks

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.experiment.trays import Tray

RATE = 30.0
"""Frames per second."""

# Largest way of the fastest bead in a time step, [m], and the fewest steps a second.
_MAX_WAY, _MIN_RATE = 2e-5, 150.0

# Most contacts between two frames.
_MAX_CONTACTS = 1000

# Noise of a place: 0.1 px at 13.5 px/mm, [m]; and of a velocity from about five frames, [m/s].
_PLACE_ERROR, _VELOCITY_ERROR = 7.4e-6, 7.4e-5


class Gas(NamedTuple):
    """Truth of a cycle.

    Parameters
    ----------
    eps, walls : float
        Restitution of beads and of walls.
    sticking : float, [m/s]
        Beads stick below this normal speed.
    speed : float, [m/s]
        Mean projected speed at the start.
    drag : float, [1/s]
        Momentum and spin of every body, whatever its size, fall as exp(-drag t).
    friction : float
        Of Coulomb, at all contacts; what slides is stopped at most.
    """

    eps: float
    walls: float = 0.97
    sticking: float = 0.0
    speed: float = 0.01
    drag: float = 0.0
    friction: float = 0.0


class Picture(NamedTuple):
    """One frame: tracks, the body of each bead, (n,), and the contacts since the last frame.

    Contacts are (m, 2): approach speed along the line of centres, [m/s], and whether it stuck.
    """

    tracks: Tracks
    bodies: np.ndarray
    contacts: np.ndarray


def pictures(tray: Tray, gas: Gas, seed: int, frames: int) -> Iterator[Picture]:
    """Tracks of a cycle from a perfect tracker, with the noise of ordinary places.

    A bead whose centre lies below another bead is not seen.
    """
    rng = np.random.default_rng([seed, tray.number])
    species = np.repeat(np.arange(len(tray.species)), [kind.count for kind in tray.species])
    radii = np.concatenate(
        [
            0.5 * rng.uniform(kind.diameter_low, kind.diameter_high, kind.count)
            for kind in tray.species
        ]
    )
    densities = np.array([kind.density for kind in tray.species])[species]
    masses = densities * 4.0 / 3.0 * np.pi * radii**3
    box = np.array(tray.dimensions)
    for frame, state in enumerate(states(masses, radii, box, gas, rng, rate=RATE)):
        if frame == frames:
            return
        seen = species, radii, state.places, state.velocities
        yield Picture(_tracks(tray, rng, frame, seen), state.bodies, state.contacts)


class State(NamedTuple):
    """Places and velocities of the beads, (n, 3), and the rest as in `Picture`."""

    places: np.ndarray
    velocities: np.ndarray
    bodies: np.ndarray
    contacts: np.ndarray


def states(
    masses: np.ndarray,
    radii: np.ndarray,
    box: np.ndarray,
    gas: Gas,
    rng: np.random.Generator,
    *,
    rate: float,
) -> Iterator[State]:
    """States of a gas, so many a second, without end."""
    places = _scattered(rng, radii, box)
    velocities = rng.normal(size=places.shape) / np.sqrt(masses)[:, None]
    velocities *= gas.speed / np.hypot(*velocities[:, :2].T).mean()
    labels = np.arange(radii.size)
    momenta, spins = masses[:, None] * velocities, np.zeros_like(places)
    truth = np.array([gas.eps, gas.walls, gas.sticking, gas.drag, gas.friction])
    contacts = np.empty((0, 2))
    while True:
        yield State(places.copy(), velocities.copy(), labels.copy(), contacts)
        way = np.linalg.norm(velocities, axis=1).max() / rate
        steps = max(int(np.ceil(way / _MAX_WAY)), math.ceil(_MIN_RATE / rate))
        log = np.empty((_MAX_CONTACTS, 2))
        count = _advance(
            places,
            velocities,
            labels,
            momenta,
            spins,
            masses,
            radii,
            box,
            truth,
            1.0 / (rate * steps),
            steps,
            log,
        )
        contacts = log[:count]


def _scattered(rng: np.random.Generator, radii: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Places at which beads do not overlap, large beads first."""
    places = np.empty((radii.size, 3))
    placed: list[int] = []
    for bead in np.argsort(-radii).tolist():
        while True:
            place = radii[bead] + rng.uniform(size=3) * (box - 2.0 * radii[bead])
            gaps = np.linalg.norm(places[placed] - place, axis=1) - radii[placed] - radii[bead]
            if (gaps > 0.0).all():
                break
        places[bead] = place
        placed.append(bead)
    return places


def _tracks(tray: Tray, rng: np.random.Generator, frame: int, state: tuple) -> Tracks:
    species, radii, places, velocities = state
    n = radii.size
    gaps = np.hypot(*(places[:, None, :2] - places[None, :, :2]).transpose(2, 0, 1))
    is_below = places[:, None, 2] < places[None, :, 2]
    seen = ~(is_below & (gaps < radii[None, :])).any(axis=1)
    return Tracks(
        stamp_ns=round(1e9 * frame / RATE),
        tray=tray.number,
        ids=np.arange(n, dtype=np.int32),
        species=species.astype(np.int32),
        displacement=np.zeros(2),
        positions=places[:, :2] + rng.normal(0.0, _PLACE_ERROR, (n, 2)),
        position_errors=np.full(n, _PLACE_ERROR),
        velocities=velocities[:, :2] + rng.normal(0.0, _VELOCITY_ERROR, (n, 2)),
        velocity_errors=np.full(n, _VELOCITY_ERROR),
        radii=radii.copy(),
        radius_errors=np.full(n, _PLACE_ERROR),
        seen=seen,
        expected=np.array([kind.count for kind in tray.species], dtype=np.int32),
        cycle=1,
    )


@numba.njit(cache=True)
def _cross(a, b):
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@numba.njit(cache=True)
def _centres(places, labels, masses, radii):
    """Mass, centre of mass and inverse tensor of inertia of each body, by its label."""
    n = masses.size
    total, centre = np.zeros(n), np.zeros((n, 3))
    inertia, inverse = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    for k in range(n):
        total[labels[k]] += masses[k]
        centre[labels[k]] += masses[k] * places[k]
    for b in range(n):
        if total[b] > 0.0:
            centre[b] /= total[b]
    for k in range(n):
        b = labels[k]
        arm = places[k] - centre[b]
        own = 0.4 * masses[k] * radii[k] * radii[k] + masses[k] * (arm * arm).sum()
        for i in range(3):
            inertia[b, i, i] += own
            for j in range(3):
                inertia[b, i, j] -= masses[k] * arm[i] * arm[j]
    for b in range(n):
        if total[b] > 0.0:
            inverse[b] = np.linalg.inv(inertia[b])
    return total, centre, inverse


@numba.njit(cache=True)
def _push(b, impulse, point, momenta, spins, centre):
    momenta[b] += impulse
    spins[b] += _cross(point - centre[b], impulse)


@numba.njit(cache=True)
def _mobility(b, point, normal, total, centre, inverse):
    """Velocity of a point of a body along a normal per impulse."""
    arm = point - centre[b]
    turn = inverse[b] @ _cross(arm, normal)
    return 1.0 / total[b] + (normal * _cross(turn, arm)).sum()


@numba.njit(cache=True)
def _velocity(b, point, momenta, spins, total, centre, inverse):
    return momenta[b] / total[b] + _cross(inverse[b] @ spins[b], point - centre[b])


@numba.njit(cache=True)
def _slide(size, velocity, normal, friction):
    """Impulse against the sliding of a contact, and the speed of the sliding."""
    along = velocity - (velocity * normal).sum() * normal
    sliding = np.sqrt((along * along).sum())
    if sliding == 0.0:
        return np.zeros(3), 0.0
    return -friction * size / sliding * along, sliding


@numba.njit(cache=True)
def _meet_walls(places, labels, momenta, spins, radii, box, truth, bodies):
    total, centre, inverse = bodies
    for k in range(radii.size):
        for axis in range(3):
            for side in range(2):
                gap = places[k, axis] if side == 0 else box[axis] - places[k, axis]
                if gap >= radii[k]:
                    continue
                normal = np.zeros(3)
                normal[axis] = 1.0 - 2.0 * side
                point = places[k] - radii[k] * normal
                b = labels[k]
                velocity = _velocity(b, point, momenta, spins, total, centre, inverse)
                approach = -(velocity * normal).sum()
                if approach > 0.0:
                    size = (1.0 + truth[1]) * approach
                    size /= _mobility(b, point, normal, total, centre, inverse)
                    hold, sliding = _slide(size, velocity, normal, truth[4])
                    strength = np.sqrt((hold * hold).sum())
                    if strength > 0.0:
                        along = hold / strength
                        most = sliding / _mobility(b, point, along, total, centre, inverse)
                        hold = min(strength, most) * along
                    _push(b, size * normal + hold, point, momenta, spins, centre)


@numba.njit(cache=True)
def _meet(places, labels, momenta, spins, radii, truth, bodies, log, count):
    """Collide the beads that overlap; the first pair that sticks, or (-1, -1), and the count."""
    total, centre, inverse = bodies
    for i in range(radii.size):
        for j in range(i + 1, radii.size):
            reach = radii[i] + radii[j]
            if abs(places[j, 0] - places[i, 0]) >= reach or labels[i] == labels[j]:
                continue
            line = places[j] - places[i]
            square = (line * line).sum()
            if square >= reach * reach:
                continue
            a, b, normal = labels[i], labels[j], line / np.sqrt(square)
            point = places[i] + radii[i] * normal
            velocity = _velocity(b, point, momenta, spins, total, centre, inverse)
            velocity = velocity - _velocity(a, point, momenta, spins, total, centre, inverse)
            approach = -(velocity * normal).sum()
            if approach <= 0.0:
                continue
            if count < len(log):
                log[count, 0] = approach
                log[count, 1] = 1.0 if approach < truth[2] else 0.0
                count += 1
            if approach < truth[2]:
                return i, j, count
            size = (1.0 + truth[0]) * approach
            size /= _mobility(a, point, normal, total, centre, inverse) + _mobility(
                b, point, normal, total, centre, inverse
            )
            hold, sliding = _slide(size, velocity, normal, truth[4])
            strength = np.sqrt((hold * hold).sum())
            if strength > 0.0:
                along = hold / strength
                yields = _mobility(a, point, along, total, centre, inverse) + _mobility(
                    b, point, along, total, centre, inverse
                )
                hold = min(strength, sliding / yields) * along
            _push(b, size * normal + hold, point, momenta, spins, centre)
            _push(a, -size * normal - hold, point, momenta, spins, centre)
    return -1, -1, count


@numba.njit(cache=True)
def _merge(a, b, labels, momenta, spins, total, centre):
    """Make one body of two, with their momentum and angular momentum."""
    low, high = min(a, b), max(a, b)
    middle = (total[a] * centre[a] + total[b] * centre[b]) / (total[a] + total[b])
    spin = spins[a] + spins[b]
    spin = spin + _cross(centre[a] - middle, momenta[a]) + _cross(centre[b] - middle, momenta[b])
    momenta[low] = momenta[a] + momenta[b]
    spins[low] = spin
    momenta[high], spins[high] = 0.0, 0.0
    for k in range(labels.size):
        if labels[k] == high:
            labels[k] = low


@numba.njit(cache=True)
def _advance(
    places, velocities, labels, momenta, spins, masses, radii, box, truth, step, steps, log
):
    """Advance by so many steps; the number of contacts in the log."""
    count = 0
    kept = np.exp(-truth[3] * step)
    for _ in range(steps):
        bodies = _centres(places, labels, masses, radii)
        for k in range(masses.size):
            b = labels[k]
            turn = bodies[2][b] @ spins[b]
            arm = places[k] - bodies[1][b]
            rate = np.sqrt((turn * turn).sum())
            drift = momenta[b] / bodies[0][b] * step
            if rate > 0.0:
                # The formula of Rodrigues keeps the shape.
                axis, angle = turn / rate, rate * step
                along = (axis * arm).sum() * axis
                turned = np.cos(angle) * (arm - along) + np.sin(angle) * _cross(axis, arm) + along
                drift = drift + turned - arm
            places[k] += drift
            velocities[k] = drift / step
        bodies = _centres(places, labels, masses, radii)
        momenta *= kept
        spins *= kept
        _meet_walls(places, labels, momenta, spins, radii, box, truth, bodies)
        while True:
            i, j, count = _meet(places, labels, momenta, spins, radii, truth, bodies, log, count)
            if i < 0:
                break
            _merge(labels[i], labels[j], labels, momenta, spins, bodies[0], bodies[1])
            bodies = _centres(places, labels, masses, radii)
    return count
