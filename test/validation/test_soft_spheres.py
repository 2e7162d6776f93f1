"""Soft spheres bounce as told, keep what contacts keep, and their pictures show them in place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.shaded_film import LabCamera, shaded_pictures
from benchmarks.soft_spheres import SoftBox, SoftRun, soft_run

_RADIUS, _MASS = 1.5e-3, 5e-5


def spheres(count, **changes):
    box = SoftBox(
        sides=(0.06, 0.045, 0.005),
        radii=(_RADIUS,) * count,
        masses=(_MASS,) * count,
        rest=0.0,
        amplitude=0.0,
    )
    return replace(box, **changes)


def energies(run):
    return (run.velocities**2).sum(axis=(1, 2))


def test_elastic_spheres_keep_their_energy():
    run = soft_run(spheres(24, restitution=1.0, wall_restitution=1.0), 5.0, rate=60.0, seed=1)
    # Part of it is in springs for the moment.
    energy = np.median(energies(run).reshape(-1, 10), axis=1)
    assert run.collisions > 20
    assert energy == pytest.approx(np.full(len(energy), energy[0]), rel=0.02)


def test_single_sphere_rebounds_with_the_restitution_of_the_walls():
    box = spheres(1, wall_restitution=0.8, sides=(0.02, 0.02, 0.02))
    run = soft_run(box, 4.0, rate=2000.0, seed=2)
    for axis in range(3):
        speeds = np.abs(run.velocities[:, 0, axis])
        # Between rebounds the speed stands still.
        levels, times = np.unique(np.round(speeds, 9), return_counts=True)
        flights = np.sort(levels[times > 20])[::-1]
        assert len(flights) > 1
        assert flights[1:] / flights[:-1] == pytest.approx(0.8, rel=2e-3)


def test_collisions_of_two_spheres_have_the_restitution_and_keep_momentum():
    runs = [free_collision(seed) for seed in range(300)]
    met = [run for run in runs if run is not None]
    assert len(met) > 3
    for velocities, _ in met:
        assert velocities[1].sum(axis=0) == pytest.approx(velocities[0].sum(axis=0), abs=1e-9)
    # The line of centres turns a little during a contact.
    ratios = [speeds[1] / speeds[0] for _, speeds in met]
    assert ratios == pytest.approx([-0.7] * len(met), rel=0.03)
    assert np.median(ratios) == pytest.approx(-0.7, rel=5e-3)


def free_collision(seed):
    """Velocities and normal speeds before and after two spheres met; None where walls were hit."""
    side = 0.009
    box = spheres(2, restitution=0.7, sides=(side, side, side), speed=0.02)
    run = soft_run(box, 0.08, rate=4000.0, seed=seed)
    apart = run.positions[:, 0] - run.positions[:, 1]
    touch = np.flatnonzero(np.linalg.norm(apart, axis=1) < 2.0 * _RADIUS)
    if not len(touch) or touch[0] == 0 or touch[-1] + 1 == len(apart) or np.ptp(touch) > 20:
        return None
    ends = [touch[0] - 1, touch[-1] + 1]
    places = run.positions[ends[0] : ends[1] + 1]
    if places.min() < _RADIUS or places.max() > side - _RADIUS:
        return None
    normal = apart[touch[len(touch) // 2]]
    velocities = run.velocities[ends]
    return velocities, (velocities[:, 0] - velocities[:, 1]) @ normal / np.linalg.norm(normal)


def test_drag_slows_free_spheres_exponentially_light_ones_more():
    box = replace(
        spheres(2, drag=0.5, sides=(1.0, 1.0, 1.0)),
        radii=(_RADIUS, 2.0 * _RADIUS),
        masses=(_MASS, 0.5 * _MASS),
    )
    run = soft_run(box, 2.0, rate=60.0, seed=3)
    times = np.arange(len(run.velocities)) / 60.0
    for number, drag in enumerate((0.5, 2.0)):
        measured = run.velocities[:, number] / run.velocities[0, number]
        expected = np.broadcast_to(np.exp(-drag * times)[:, None], measured.shape)
        assert measured == pytest.approx(expected, rel=1e-3)


def test_friction_makes_spheres_slower_along_the_walls():
    fast, slow = (
        soft_run(
            spheres(1, friction=friction, wall_restitution=1.0), 6.0, rate=60.0, seed=4
        ).velocities[:, 0]
        for friction in (0.0, 0.1)
    )
    assert np.hypot(*fast[-1, :2]) == pytest.approx(np.hypot(*fast[0, :2]), rel=1e-3)
    assert np.hypot(*slow[-1, :2]) < 0.9 * np.hypot(*slow[0, :2])


def test_all_rest_until_the_box_is_shaken():
    box = spheres(6, rest=1.0, amplitude=1e-3)
    run = soft_run(box, 4.0, rate=60.0, seed=5)
    assert not run.velocities[:60].any()
    assert not run.displacement[:60].any()
    assert 0.5e-3 < np.abs(run.displacement).max() < 1.1e-3
    assert run.displacement[-1] == pytest.approx(0.0, abs=1e-12)


def test_pictures_show_spheres_where_they_are_larger_the_nearer_they_are():
    box = spheres(2, sides=(0.06, 0.045, 0.02))
    places = np.array([[0.02, 0.015, _RADIUS], [0.041, 0.0302, 0.0185]])
    run = SoftRun(
        positions=np.stack([places, places]),
        velocities=np.zeros((2, 2, 3)),
        displacement=np.zeros((2, 2)),
        collisions=0,
    )
    camera = LabCamera(
        size=(560, 440),
        scale=8000.0,
        centre=(281.5, 218.0),
        floor=(30.0, 30.0, 30.0),
        beads=((230.0, 230.0, 230.0),),
        # Evenly lit, and sharp.
        ambient=1.0,
        highlight=0.0,
        shadow=0.0,
        noise=0.0,
        vignette=0.0,
        blur=0.1,
    )
    (picture,) = shaded_pictures(run, box, np.zeros(2, dtype=int), camera)
    bright = picture[..., 0] > 100
    # The rim is brighter than the floor.
    left, top = camera.centre - 0.5 * camera.scale * np.array(box.sides[:2])
    bright[: int(top) + 5], bright[:, : int(left) + 5] = False, False
    bright[-int(top) - 5 :], bright[:, -int(left) - 5 :] = False, False
    rows, columns = np.nonzero(bright)
    for place in places:
        scale = camera.scale * camera.distance / (camera.distance - place[2])
        aside = place[:2] - 0.5 * np.array(box.sides[:2])
        column, row = np.array(camera.centre) + scale * aside
        own = np.hypot(columns - column, rows - row) < 2.0 * _RADIUS * scale
        assert columns[own].mean() == pytest.approx(column, abs=0.1)
        assert rows[own].mean() == pytest.approx(row, abs=0.1)
        assert np.sqrt(own.sum() / np.pi) == pytest.approx(_RADIUS * scale, rel=0.02)
