"""The small engine of flat discs keeps what collisions keep, and its discs bounce as told."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.flat_discs import FlatBox, flat_pictures, flat_run


def test_discs_never_overlap_and_stay_in_the_box():
    box = FlatBox()
    run = flat_run(box, 10.0, seed=1)
    apart = np.linalg.norm(run.places[:, :, None] - run.places[:, None], axis=-1)
    apart[:, range(box.count), range(box.count)] = np.inf
    assert apart.min() > 2.0 * box.radius * (1.0 - 1e-9)
    assert run.places.min() > box.radius * (1.0 - 1e-6)
    assert len(run.collisions) > 30


def test_elastic_discs_keep_their_energy():
    run = flat_run(FlatBox(restitution=1.0, wall_restitution=1.0), 5.0, seed=2)
    energy = (run.velocities**2).sum(axis=(1, 2))
    assert energy == pytest.approx(np.full(len(energy), energy[0]))


def test_a_disc_that_falls_bounces_ever_lower_and_rolls_at_last():
    box = FlatBox(count=1, gravity=(0.0, 0.4), wall_restitution=0.7)
    run = flat_run(box, 6.0, seed=3)
    floor = run.rebounds[run.rebounds[:, 2] == 3]
    free = floor[1:, 1] / floor[:-1, 1]
    assert free[:5] == pytest.approx(0.7)
    assert run.places[-1, 0, 1] == pytest.approx(box.sides[1] - box.radius, abs=1e-6)
    assert run.velocities[-1, 0, 1] == 0.0
    assert abs(run.velocities[-1, 0, 0]) > 0.0


def test_pictures_show_the_discs_at_their_places():
    box = FlatBox(count=2)
    run = flat_run(box, 0.05, seed=4)
    picture = next(iter(flat_pictures(run, box, 8000.0)))
    assert picture.shape == (360, 480, 3)
    for x, y in run.places[0] * 8000.0:
        assert picture[int(y), int(x)].max() < 70
