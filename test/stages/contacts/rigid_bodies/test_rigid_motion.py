"""Free motion of a rigid body of beads, against Euler's equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from nanorocks_ros.stages.contacts.rigid_bodies.rigid_motion import inertia_of, move_freely

SINCE = np.linspace(-0.5, 0.5, 31)
RADIUS = 1e-3


def arms_of(places):
    places = RADIUS * np.array(places)
    return places - places.mean(axis=0)


BODIES = {
    'two beads': arms_of([[0.0, 0.0, 0.0], [1.6, 0.0, 1.2]]),
    'three in an angle': arms_of([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.5, 1.9, 0.4]]),
    'four in a row and aside': arms_of(
        [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [4.0, 0.0, 0.3], [1.0, 1.7, 0.4]]
    ),
}


def euler(arms, spin, times):
    """Arms (n, m, 3) by a rotation vector of small steps and the spin in axes of the body."""
    count = len(arms)
    inertia = inertia_of(arms, np.full(count, 1.0 / count), np.full(count, RADIUS))

    def change(_, state):
        turned = Rotation.from_quat(state[:4])
        own = state[4:]
        half = np.append(0.5 * turned.apply(own), 0.0)
        own_change = np.linalg.solve(inertia, np.cross(inertia @ own, own))
        return np.concatenate([_product(half, state[:4]), own_change])

    start = np.concatenate([[0.0, 0.0, 0.0, 1.0], spin])
    solution = solve_ivp(change, (0.0, times[-1]), start, t_eval=times, rtol=1e-10, atol=1e-12)
    return np.array([Rotation.from_quat(state[:4]).apply(arms) for state in solution.y.T])


def _product(first, second):
    """Product of two quaternions with the scalar last."""
    vector = first[3] * second[:3] + second[3] * first[:3] + np.cross(first[:3], second[:3])
    return np.append(vector, first[3] * second[3] - first[:3] @ second[:3])


def places_of(arms, spin, since=SINCE):
    masses = np.full(len(arms), 1.0 / len(arms)), np.full(len(arms), RADIUS)
    places = np.empty((since.size, len(arms), 2))
    move_freely((np.zeros(2), arms), masses, (np.array([3e-3, -1e-3]), spin), since, places)
    return places


@pytest.mark.parametrize('name', BODIES)
@pytest.mark.parametrize('spin', [(0.4, -2.0, 1.5), (3.0, 1.0, -4.0)])
def test_a_free_body_turns_by_eulers_equations(name, spin):
    arms, spin = BODIES[name], np.array(spin)
    later = SINCE[SINCE >= 0.0]
    moved = later[:, None, None] * np.array([3e-3, -1e-3])
    np.testing.assert_allclose(
        places_of(arms, spin)[SINCE >= 0.0],
        moved + euler(arms, spin, later)[:, :, :2],
        atol=1e-4 * RADIUS,
    )


def test_time_turns_back():
    """Before the time 0 a body is where the same with the opposite motion is after it."""
    arms, spin = BODIES['three in an angle'], np.array([0.4, -2.0, 1.5])
    masses = np.full(3, 1.0 / 3.0), np.full(3, RADIUS)
    back = np.empty((SINCE.size, 3, 2))
    move_freely((np.zeros(2), arms), masses, (np.array([-3e-3, 1e-3]), -spin), SINCE, back)
    np.testing.assert_allclose(places_of(arms, spin), back[::-1], atol=1e-12)


def test_a_body_of_three_beads_does_not_turn_about_a_constant_axis():
    arms, spin = BODIES['three in an angle'], np.array([3.0, 1.0, -4.0])
    fixed = [Rotation.from_rotvec(time * spin).apply(arms)[:, :2] for time in SINCE]
    moved = SINCE[:, None, None] * np.array([3e-3, -1e-3])
    assert np.abs(places_of(arms, spin) - moved - fixed).max() > 0.1 * RADIUS
