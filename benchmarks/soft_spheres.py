"""Soft spheres in a shaken box, in small steps of time: an engine beside that of the package.

A contact is a linear spring with a dashpot, made for the restitution (Cundall and Strack,
Géotechnique 29, 47, 1979); it lasts `CONTACT_TIME`, while contacts of
`nanorocks_ros.simulation` are instants. They share nothing.

Tested by ``test/validation/test_soft_spheres.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

CONTACT_TIME = 1.5e-3
"""Duration of a contact of two of the lightest spheres, about, [s]."""

_STEPS_PER_CONTACT = 60
# A sphere that slides slower than this is held by a viscous force, [m/s].
_CREEP = 2e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftBox:
    """What is in the box, and how it is shaken.

    Parameters
    ----------
    sides : tuple of 3 floats, [m]
    radii, masses : tuple of floats, (count,), [m], [kg]
    restitution, wall_restitution : float
        Floor and lid are walls, too.
    friction : float
        Of Coulomb, at all contacts.
    drag : float, [1/s]
        Of Stokes, of the first sphere: alone it slows down as exp(-drag t). The force on others
        is as much larger as their radius.
    speed : float, [m/s]
        Standard deviation of a component of the first velocities.
    rest : float, [s]
        All is at rest that long, before it is shaken.
    shaking : float, [s]
        Duration of the shaking.
    amplitude, frequency : float, [m], [1/s]
        Of the box along its first side while it is shaken, swelling and fading; along the second
        0.6 times as far at 1.31 times the frequency.
    """

    sides: tuple[float, float, float]
    radii: tuple[float, ...]
    masses: tuple[float, ...]
    restitution: float = 0.9
    wall_restitution: float = 0.9
    friction: float = 0.0
    drag: float = 0.0
    speed: float = 0.011
    rest: float = 1.5
    shaking: float = 1.6
    amplitude: float = 1e-3
    frequency: float = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SoftRun:
    """Positions and velocities in each picture, and the place of the box.

    Parameters
    ----------
    positions, velocities : ndarray (pictures, count, 3), [m], [m/s]
        From the corner of the box at rest.
    displacement : ndarray (pictures, 2), [m]
        Of the box.
    collisions : int
        Contacts of two spheres that began.
    """

    positions: np.ndarray
    velocities: np.ndarray
    displacement: np.ndarray
    collisions: int


def soft_run(box: SoftBox, seconds: float, *, rate: float, seed: int) -> SoftRun:
    """Let spheres rest, shake them, and follow them for so many seconds in all.

    Parameters
    ----------
    box : SoftBox
    seconds : float, [s]
    rate : float, [1/s]
        Of the pictures.
    seed : int
        Of the first places and velocities.
    """
    random = np.random.default_rng(seed)
    places = places_apart(box, random)
    velocities = box.speed * random.standard_normal(places.shape)
    every = math.ceil(_STEPS_PER_CONTACT / (CONTACT_TIME * rate))
    step = 1.0 / (rate * every)
    at_rest = round(box.rest * rate)
    pictures = round(seconds * rate) - at_rest
    displacement, box_velocity = shaken(box, pictures * every, step)
    masses = np.array(box.masses)
    stiffness = 0.5 * masses.min() * (math.pi / CONTACT_TIME) ** 2
    shape = pictures, *places.shape
    all_places, all_velocities = np.empty(shape), np.empty(shape)
    collisions = _follow(
        (places, velocities, np.zeros_like(places)),
        (np.array(box.radii), masses, np.array(box.sides)),
        (displacement, box_velocity),
        np.array(
            [
                step,
                stiffness,
                math.log(box.restitution),
                math.log(box.wall_restitution),
                box.friction,
                box.drag,
            ]
        ),
        (all_places, all_velocities),
        (
            np.zeros((len(masses), len(masses)), dtype=np.bool_),
            np.zeros((2, *places.shape)),
            np.zeros((2, 3)),
        ),
        every,
    )
    still = np.repeat(all_places[:1], at_rest, axis=0)
    return SoftRun(
        positions=np.concatenate([still, all_places]),
        velocities=np.concatenate([np.zeros_like(still), all_velocities]),
        displacement=np.concatenate([np.zeros((at_rest, 2)), displacement[::every]]),
        collisions=int(collisions),
    )


def places_apart(box: SoftBox, random: np.random.Generator) -> np.ndarray:
    """Places of spheres that touch neither each other nor a wall, (count, 3), [m]."""
    places: list[np.ndarray] = []
    while len(places) < len(box.radii):
        radius = 1.02 * box.radii[len(places)]
        place = random.uniform(radius, np.array(box.sides) - radius)
        gaps = [
            math.dist(place, other) - radius - 1.02 * box.radii[k]
            for k, other in enumerate(places)
        ]
        if min(gaps, default=1.0) > 0.0:
            places.append(place)
    return np.array(places)


def shaken(box: SoftBox, steps: int, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity of the box at each step, (steps, 2)."""
    times = step * np.arange(steps)
    displacement = np.zeros((steps, 2))
    if box.amplitude > 0.0:
        swell = np.sin(np.pi * np.clip(times / box.shaking, 0.0, 1.0)) ** 2
        for axis, (part, faster) in enumerate(((1.0, 1.0), (0.6, 1.31))):
            phase = 2.0 * np.pi * box.frequency * faster * times
            displacement[:, axis] = part * box.amplitude * swell * np.sin(phase + axis)
    return displacement, np.gradient(displacement, step, axis=0)


@compiled
def _follow(state, beads, shaken, constants, kept, scratch, every):
    """Advance by half-implicit steps of Euler; returns the number of collisions."""
    places, velocities, spins = state
    radii, masses, _ = beads
    displacement, box_velocity = shaken
    step, drag = constants[0], constants[5]
    forces, torques = scratch[1][0], scratch[1][1]
    collisions = 0
    for k in range(len(displacement)):
        if k % every == 0 and k // every < len(kept[0]):
            for i in range(len(radii)):
                for c in range(3):
                    kept[0][k // every, i, c] = places[i, c]
                    kept[1][k // every, i, c] = velocities[i, c]
        for i in range(len(radii)):
            for c in range(3):
                forces[i, c] = -drag * masses[0] * radii[i] / radii[0] * velocities[i, c]
                torques[i, c] = 0.0
        collisions += _press_each_other(state, beads, constants, scratch)
        _press_walls(state, beads, (displacement[k], box_velocity[k]), constants, scratch)
        for i in range(len(radii)):
            inertia = 0.4 * masses[i] * radii[i] * radii[i]
            for c in range(3):
                velocities[i, c] += step * forces[i, c] / masses[i]
                places[i, c] += step * velocities[i, c]
                spins[i, c] += step * torques[i, c] / inertia
    return collisions


@compiled
def _press_each_other(state, beads, constants, scratch):
    """Add forces of spheres on each other; returns how many contacts begin."""
    places, velocities, spins = state
    radii, masses, _ = beads
    touching, (forces, torques), geometry = scratch[0], (scratch[1][0], scratch[1][1]), scratch[2]
    stiffness, friction = constants[1], constants[4]
    new = 0
    for i in range(len(radii)):
        for j in range(i + 1, len(radii)):
            reach = radii[i] + radii[j]
            square = 0.0
            for c in range(3):
                geometry[0, c] = places[i, c] - places[j, c]
                square += geometry[0, c] * geometry[0, c]
            if square >= reach * reach:
                touching[i, j] = False
                continue
            new += not touching[i, j]
            touching[i, j] = True
            distance = math.sqrt(square)
            for c in range(3):
                geometry[0, c] /= distance
                geometry[1, c] = velocities[i, c] - velocities[j, c]
            mass = masses[i] * masses[j] / (masses[i] + masses[j])
            push = _push(geometry, reach - distance, mass, stiffness, constants[2])
            _rub(geometry, radii[i], spins[i])
            _rub(geometry, radii[j], spins[j])
            hold = _hold(geometry, push, friction)
            _apply(forces[i], torques[i], geometry, push, hold, radii[i], 1.0)
            _apply(forces[j], torques[j], geometry, push, hold, radii[j], -1.0)
    return new


@compiled
def _press_walls(state, beads, box, constants, scratch):
    """Add forces of the walls, which are at a displacement and move with a velocity."""
    places, velocities, spins = state
    radii, masses, sides = beads
    forces, torques, geometry = scratch[1][0], scratch[1][1], scratch[2]
    for i in range(len(radii)):
        for wall in range(6):
            axis, side = wall // 2, wall % 2
            inward = 1.0 - 2.0 * side
            place = side * sides[axis] + (box[0][axis] if axis < 2 else 0.0)
            overlap = radii[i] - inward * (places[i, axis] - place)
            if overlap <= 0.0:
                continue
            for c in range(3):
                geometry[0, c] = inward if c == axis else 0.0
                geometry[1, c] = velocities[i, c] - (box[1][c] if c < 2 else 0.0)
            push = _push(geometry, overlap, masses[i], constants[1], constants[3])
            _rub(geometry, radii[i], spins[i])
            hold = _hold(geometry, push, constants[4])
            _apply(forces[i], torques[i], geometry, push, hold, radii[i], 1.0)


@compiled
def _push(geometry, overlap, mass, stiffness, log_restitution):
    """Force along the normal, row 0; what is left of the velocity, row 1, is along the contact."""
    normal, velocity = geometry[0], geometry[1]
    along = normal[0] * velocity[0] + normal[1] * velocity[1] + normal[2] * velocity[2]
    for c in range(3):
        velocity[c] -= along * normal[c]
    damping = math.sqrt(stiffness * mass / (math.pi * math.pi + log_restitution * log_restitution))
    return stiffness * overlap + 2.0 * log_restitution * damping * along


@compiled
def _rub(geometry, radius, spin):
    """Add the velocity of the surface of a spinning sphere to that along the contact."""
    normal, velocity = geometry[0], geometry[1]
    velocity[0] -= radius * (spin[1] * normal[2] - spin[2] * normal[1])
    velocity[1] -= radius * (spin[2] * normal[0] - spin[0] * normal[2])
    velocity[2] -= radius * (spin[0] * normal[1] - spin[1] * normal[0])


@compiled
def _hold(geometry, push, friction):
    """Force along the contact over its velocity, negative."""
    velocity = geometry[1]
    sliding = math.sqrt(
        velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]
    )
    return -friction * abs(push) / max(sliding, _CREEP)


@compiled
def _apply(force, torque, geometry, push, hold, radius, sign):
    """Add force and torque of a contact to those of a sphere."""
    normal, velocity = geometry[0], geometry[1]
    for c in range(3):
        force[c] += sign * (push * normal[c] + hold * velocity[c])
    # The arm is -sign radius normal, the force sign hold velocity.
    arm = -radius * hold
    torque[0] += arm * (normal[1] * velocity[2] - normal[2] * velocity[1])
    torque[1] += arm * (normal[2] * velocity[0] - normal[0] * velocity[2])
    torque[2] += arm * (normal[0] * velocity[1] - normal[1] * velocity[0])
