"""Restitutions from contacts alone: in a driven state, under gravity, of a single ball, in 2-D."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, tracks_of

from benchmarks.accelerated_tray import AcceleratedTray
from benchmarks.short_films import CASES, flat_tracks, high_tracks
from benchmarks.soft_spheres import SoftBox, soft_run
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.stages.contact_restitution.track_contacts import track_contacts

TRAY = load_trays()[1]
SETTINGS = PipelineSettings()
NOISE = 0.05 * PIXEL


def bouncing(gravity, restitution, seconds, *, along=0.004):
    """Positions of a ball of 2 mm over a floor at 20 mm, rows downwards, (frames, 1, 2)."""
    floor, height, speed, x, step = 0.019, 0.008, 0.0, 0.004, 1e-4
    positions = []
    for k in range(round(seconds / step)):
        if k % round(1.0 / (RATE * step)) == 0:
            positions.append([[x, floor - height]])
        height -= speed * step + 0.5 * gravity * step**2
        speed += gravity * step
        x += along * step
        if height < 0.0:
            # Back to the instant of the contact, and on from there.
            late = -height / speed
            speed = restitution * (speed - gravity * late)
            height, speed = speed * late - 0.5 * gravity * late**2, -(speed - gravity * late)
    return np.array(positions)


def test_a_ball_on_a_floor_gives_its_restitution_and_gravity():
    paths = bouncing(0.1, 0.8, 3.6)
    result = track_contacts(
        list(tracks_of(paths, jitter=NOISE)), TRAY, SETTINGS, container_known=False
    )
    assert result.acceleration.is_seen
    assert result.acceleration.value == pytest.approx((0.0, 0.1), abs=0.003)
    assert result.walls.turns[3] >= 3
    assert result.walls.places[3] == pytest.approx(0.020, abs=1e-4)
    assert set(result.alone.by_wall) == {3}
    floor = result.alone.by_wall[3].restitution
    assert floor.lower < 0.8 < floor.upper
    assert floor.upper - floor.lower < 0.05
    assert not result.collisions
    assert math.isnan(result.alone.beads.restitution.value)


def test_a_slower_clock_changes_gravity_and_not_the_restitution():
    records = list(tracks_of(bouncing(0.1, 0.8, 3.6), jitter=NOISE))
    corrected = track_contacts(records, TRAY, SETTINGS, container_known=False)
    slow = [replace(record, stamp_ns=2 * record.stamp_ns) for record in records]
    slowed = track_contacts(slow, TRAY, SETTINGS, container_known=False)
    assert slowed.acceleration.value[1] == pytest.approx(0.025, abs=0.001)
    assert slowed.alone.walls.restitution.value == pytest.approx(
        corrected.alone.walls.restitution.value, abs=2e-3
    )


@pytest.fixture(scope='module')
def falling_gas():
    """Tracks of a gas that an acceleration drives, with restitutions 0.85 and 0.93."""
    settings = SimulationSettings(
        restitution=0.85, wall_restitution=0.93, seed=1, mean_speed=0.010, first_shake=0.0
    )
    moments = list(AcceleratedTray(settings, TRAY, 0, (0.004, -0.003, 0.0)).moments(300))
    positions = np.array([moment.positions[:, :2] for moment in moments])
    velocities = np.array([moment.velocities[:, :2] for moment in moments])
    return list(tracks_of(positions, velocities=velocities, jitter=0.02 * PIXEL))


@pytest.mark.parametrize('known', [True, False])
def test_a_gas_that_falls_gives_both_restitutions_whether_the_walls_are_told(falling_gas, known):
    result = track_contacts(falling_gas, TRAY, SETTINGS, container_known=known)
    assert result.acceleration.value == pytest.approx((0.004, -0.003), abs=2e-4)
    beads, walls = result.alone.beads, result.alone.walls
    assert beads.contacts > 12
    assert walls.contacts > 20
    assert beads.restitution.lower < 0.85 < beads.restitution.upper
    assert walls.restitution.lower < 0.93 < walls.restitution.upper
    assert walls.restitution.upper - walls.restitution.lower < 0.02


def test_a_driven_tray_in_a_steady_state_gives_both_restitutions():
    settings = SimulationSettings(
        restitution=0.85, wall_restitution=0.93, seed=3, mean_speed=0.008, first_shake=0.0
    )
    motion = WallMotion(amplitude=(6e-4, 4e-4, 0.0), angular_frequency=2.0 * math.pi * 1.3)
    rules = rules_of(settings, TRAY, 0)
    beads = after_shaking(settings, rules, resting_beads(settings, TRAY), 0, 0)
    times = np.arange(900) / RATE
    run = HardSphereGas(beads, replace(rules, motion=motion)).follow(times[-1], times)
    shift = np.outer(np.sin(motion.angular_frequency * times), motion.amplitude[:2])
    result = track_contacts(
        list(
            tracks_of(
                run.positions[:, :, :2],
                velocities=run.velocities[:, :, :2],
                displacements=shift,
                jitter=0.02 * PIXEL,
            )
        ),
        TRAY,
        SETTINGS,
    )
    beads_alone, walls = result.alone.beads, result.alone.walls
    # Driven: at the end the beads are as fast as the walls, and there are contacts throughout.
    assert max(contact.stamp_ns for contact in result.contacts) > 0.9e9 * times[-1]
    assert beads_alone.contacts > 30
    assert walls.contacts > 30
    assert beads_alone.restitution.lower < 0.85 < beads_alone.restitution.upper
    assert walls.restitution.lower < 0.93 < walls.restitution.upper


def test_films_without_contacts_give_no_restitution():
    time = np.arange(60) / RATE
    straight = np.stack([0.004 + 0.003 * time, 0.004 + 0.001 * time], axis=1)[:, None]
    for known in (True, False):
        result = track_contacts(
            list(tracks_of(straight, jitter=NOISE)), TRAY, SETTINGS, container_known=known
        )
        assert result.contacts == ()
        assert math.isnan(result.alone.walls.restitution.value)
        assert not result.acceleration.is_seen


def test_empty_tracks_are_no_error():
    result = track_contacts([], TRAY, SETTINGS, container_known=False)
    assert result.contacts == ()
    assert result.frames == 0


@pytest.fixture(scope='module')
def high_gas():
    """Tracks of gases of tray 1, which is half a bead higher than its beads, and of flat discs."""
    high = [high_tracks(10.0, seed, 0.1) for seed in range(200, 206)]
    case = CASES[1]
    return high, [flat_tracks(case, seed) for seed in range(200, 206)]


@pytest.mark.parametrize('told', [0.97, 1.0, 1.03])
def test_the_tilt_of_collisions_follows_from_their_distances_whatever_the_diameter(high_gas, told):
    for films, side in zip(high_gas, (2.0, 3.0), strict=True):
        tray = load_trays(
            f'trays:\n  1:\n    dimensions_mm: [60, 60]\n    species:\n'
            f'      - {{diameter_mm: {told * side}, look: auto}}\n'
        )[1]
        beads = [
            track_contacts(film, tray, SETTINGS, container_known=False).alone.beads.restitution
            for film in films
        ]
        off = np.array([value.value - 0.85 for value in beads])
        errors = np.array([value.error for value in beads])
        assert abs(off.mean()) < 2.0 * errors.mean() / math.sqrt(off.size)
        assert np.abs(off / errors).max() < 2.5


def rubbing(friction, seed):
    """Contacts of soft spheres of 2 mm in tray 1, which is higher than they, with friction."""
    box = SoftBox(
        sides=TRAY.dimensions,
        radii=(1e-3,) * TRAY.count,
        masses=(5e-6,) * TRAY.count,
        wall_restitution=0.9,
        friction=friction,
        speed=0.01,
        rest=0.0,
        amplitude=0.0,
    )
    run = soft_run(box, 14.0, rate=RATE, seed=seed)
    paths, velocities = run.positions[..., :2], run.velocities[..., :2]
    tracks = list(tracks_of(paths, velocities=velocities, jitter=NOISE))
    return track_contacts(tracks, TRAY, SETTINGS).alone


def test_walls_that_rub_are_held_and_those_that_do_not_are_as_exact():
    # Read as smooth 9 of 15 intervals held.
    rough = [rubbing(friction, seed).walls for friction in (0.02, 0.05, 0.1) for seed in range(4)]
    held = [walls.restitution.lower < 0.9 < walls.restitution.upper for walls in rough]
    assert np.mean(held) > 0.85
    smooth = [rubbing(0.0, seed).walls.restitution for seed in range(4)]
    assert np.mean([walls.lower < 0.9 < walls.upper for walls in smooth]) > 0.7
    # 0.0043 without friction in the likelihood.
    assert np.mean([walls.upper - walls.lower for walls in smooth]) < 0.005
