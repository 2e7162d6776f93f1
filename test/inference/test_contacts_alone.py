"""Restitutions from contacts alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from wall_rebounds import wall_rebounds

from nanorocks_ros.inference.contacts_alone import contacts_alone
from nanorocks_ros.records import PairCollision
from nanorocks_ros.settings import PriorSettings

PRIOR = PriorSettings()
DIAMETER = 2e-3
ERROR = 2e-5


def planar_collisions(restitution, count, seed=1):
    """Collisions of equal discs in a layer as high as they are, at any angle and impact."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        angle = rng.uniform(0.0, 2.0 * math.pi)
        normal = np.array([math.cos(angle), math.sin(angle)])
        before = rng.normal(0.0, 0.005, (2, 2))
        approach = (before[0] - before[1]) @ normal
        if approach < 0.0:
            before, approach = before[::-1], -approach
        impulse = 0.5 * (1.0 + restitution) * approach * normal
        after = before + np.array([-impulse, impulse])
        if approach < 3e-3:
            continue
        yield PairCollision(
            stamp_ns=number,
            tray=1,
            tracks=np.array([0, 1], dtype=np.int32),
            species=np.zeros(2, dtype=np.int32),
            radii=np.full(2, 0.5 * DIAMETER),
            radius_errors=np.zeros(2),
            masses=np.ones(2),
            before=before + rng.normal(0.0, ERROR, (2, 2)),
            after=after + rng.normal(0.0, ERROR, (2, 2)),
            before_errors=np.full(2, ERROR),
            after_errors=np.full(2, ERROR),
            separation=DIAMETER * normal + rng.normal(0.0, 2e-6, 2),
            separation_error=2e-6,
            temperatures=np.full(2, 2.5e-5),
            height=DIAMETER,
            place=np.zeros(2),
        )


@pytest.mark.parametrize('truth', [0.4, 0.9])
def test_a_layer_as_high_as_its_beads_gives_their_restitution(truth):
    result = contacts_alone(planar_collisions(truth, 60), (), PRIOR)
    assert result.beads.restitution.lower < truth < result.beads.restitution.upper
    assert result.beads.restitution.error < 0.02
    assert result.walls.contacts == 0
    assert math.isnan(result.walls.restitution.value)


def test_walls_far_below_those_of_the_flight_are_read():
    rebounds = [
        replace(rebound, outgoing=replace(rebound.outgoing, value=0.3 * rebound.incoming.value))
        for rebound in wall_rebounds(np.random.default_rng(1), 20, 0.0, 17.0, 0.0)
    ]
    result = contacts_alone(rebounds, (), PRIOR)
    assert result.walls.restitution.value == pytest.approx(0.3, abs=0.01)
    assert sum(wall.contacts for wall in result.by_wall.values()) == 20


def test_nothing_is_known_without_contacts():
    result = contacts_alone((), (), PRIOR)
    assert (result.beads.contacts, result.walls.contacts) == (0, 0)
    assert result.by_wall == {}


def test_contacts_without_a_known_speed_of_that_time_are_no_error():
    pairs = list(planar_collisions(0.8, 10))
    unknown = [replace(pair, temperatures=np.full(2, math.nan)) for pair in pairs]
    assert contacts_alone(unknown, (), PRIOR).beads.contacts == 0
    lost = [replace(pair, friction_length=math.nan) for pair in pairs]
    assert contacts_alone(lost, (), PRIOR) == contacts_alone(pairs, (), PRIOR)
