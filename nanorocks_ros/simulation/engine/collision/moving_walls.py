"""Walls that move with the tray: where they are, and when a bead meets one.

Tested by ``test/simulation/engine/collision/test_conservation_ledger.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.exponentials import decay_time, decayed
from nanorocks_ros.simulation.engine.flight.drag_rates import flown

if TYPE_CHECKING:
    from nanorocks_ros.simulation.engine.rules.collision_rules import Rules

# A gap of this fraction of the radius is a contact; a contact is found within this many steps.
_CLOSED = 1e-13
_MOST_STEPS = 10_000
# Smallest step of time relative to the time: some units in the last place.
_LEAST_STEP = 2e-15


@compiled
def tray_displacement(rules: Rules, axis: int, time: float) -> tuple[float, float]:
    """Displacement and velocity of the tray along an axis at a time, [m], [m/s]."""
    if not (rules.moving and rules.start <= time < rules.end):
        return 0.0, 0.0
    since = time - rules.start
    size = rules.amplitude[axis] * math.exp(-rules.damping * since)
    phase = rules.angular_frequency * since
    wave = math.sin(phase)
    slope = rules.angular_frequency * math.cos(phase) - rules.damping * wave
    return size * wave, size * slope


@compiled
def largest_acceleration(rules: Rules, axis: int, time: float) -> float:
    """Bound on the acceleration of the tray along an axis from a time on, [m/s^2]."""
    if time >= rules.end:
        return 0.0
    rate = rules.angular_frequency + rules.damping
    since = max(time - rules.start, 0.0)
    size = abs(rules.amplitude[axis]) * math.exp(-rules.damping * since)
    return float(size * rate * rate)


@compiled
def largest_excursion(rules: Rules, axis: int, time: float) -> float:
    """Largest displacement of the tray along an axis from a time on, [m]."""
    if time >= rules.end:
        return 0.0
    return abs(rules.amplitude[axis]) * math.exp(-rules.damping * max(time - rules.start, 0.0))


@compiled
def time_to_moving_wall(
    rules: Rules, axis: int, bead: tuple[float, float, float, float], far: int, now: float
) -> float:
    """Time at which a bead meets a wall that moves with the tray.

    The gap is never smaller than a parabola that bends as much as the wall can accelerate;
    each step goes to where that parabola closes, so that no contact is stepped over.

    Parameters
    ----------
    rules : Rules
    axis : int
    bead : tuple of 4 floats, [m], [m/s], [m], [1/s]
        Coordinate, velocity and radius, and the decay rate of the velocity.
    far : int
        0 for the low wall, 1 for the high one.
    now : float, [s]
        Absolute.

    Returns
    -------
    float, [s]
        Infinite when it never does.
    """
    position, velocity, radius, rate = bead
    outward = 1.0 if far else -1.0
    # Distance from the wall at rest, and how fast it shrinks.
    distance = rules.sides[axis] - radius - position if far else position - radius
    first = outward * velocity
    closing = first
    time = now
    for _ in range(_MOST_STEPS):
        left = distance - first * flown(rate, time - now)
        if rate > 0.0:
            closing = first * decayed(rate * (time - now))[1]
        beyond = left - largest_excursion(rules, axis, time)
        if beyond > _CLOSED * radius:
            # Out of reach of the wall at any displacement.
            if closing <= 0.0:
                return np.inf
            wait = beyond / closing
            if rate > 0.0:
                wait = decay_time(rate * wait) / rate
            time += max(wait, _LEAST_STEP * abs(time))
            if math.isinf(time):
                break
            continue
        moved, speed = tray_displacement(rules, axis, time)
        gap = left + outward * moved
        opening = outward * speed - closing
        if gap <= _CLOSED * radius and opening < 0.0:
            return time
        bend = rate * max(-closing, 0.0)
        time = earliest_contact_time(rules, axis, time, (max(gap, 0.0), opening, bend))
        if math.isinf(time):
            break
    return time


@compiled
def earliest_contact_time(
    rules: Rules, axis: int, time: float, approach: tuple[float, float, float]
) -> float:
    """Lower bound of the time at which the gap to a moving wall closes.

    Parameters
    ----------
    rules : Rules
    axis : int
    time : float, [s]
    approach : tuple of 3 floats, [m], [m/s], [m/s^2]
        Gap and its opening speed at that time; how fast drag slows the opening.
    """
    gap, opening, bend = approach
    until = np.inf
    if time < rules.start:
        until = rules.start
    elif time < rules.end:
        bend += largest_acceleration(rules, axis, time)
        until = rules.end
    root = math.sqrt(opening * opening + 2.0 * bend * gap)
    if opening < 0.0:
        step = 2.0 * gap / (root - opening)
    elif bend > 0.0:
        step = (opening + root) / bend
    else:
        step = np.inf
    # Where the bead rides on the wall, time must still advance to the next contact.
    step = max(step, _LEAST_STEP * abs(time), 1e-9 * rules.contact_duration)
    return min(time + step, until)
