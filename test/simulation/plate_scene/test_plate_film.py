"""Films of the scene: ground truth of every bead, and reproducibility."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes import PLAIN, SIMULATION, TRAYS

from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.settings import SceneSettings, rows
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm, without_effects
from nanorocks_ros.simulation.plate_scene.plate_oscillation import plate_motion, wall_motion_of
from nanorocks_ros.simulation.shaken_tray import ShakenTray

SHAKEN = replace(SIMULATION, first_shake=0.1, width_px=800, height_px=640)
SMALL = replace(PLAIN, pixels_per_metre=7500.0, trays=(1, 3))
SWINGING = replace(SMALL, swing=0.0002)


def film(simulation=SHAKEN, scene=SMALL):
    return SceneFilm(simulation, scene)


def test_the_truth_agrees_with_the_gas_in_each_tray():
    scene_moment = film().at(9, 300_000_000)
    for truth, beads, number in zip(scene_moment.trays, scene_moment.beads, (1, 3), strict=True):
        gas = ShakenTray(replace(SHAKEN, tray=number), TRAYS[number], run=number)
        positions, velocities = gas.at(0.3)
        np.testing.assert_array_equal(beads.positions, positions)
        np.testing.assert_array_equal(beads.velocities, velocities)
        np.testing.assert_array_equal(beads.radii, gas.radii)
        assert truth.tray == beads.tray == number
        assert truth.cycle == beads.cycle == 1
        assert truth.stamp_ns == beads.stamp_ns == scene_moment.frame.stamp_ns == 300_000_000
        assert truth.mean_projected_speed == pytest.approx(beads.projected_speeds.mean())
        assert [np.sum(beads.species == k) for k in range(len(TRAYS[number].species))] == [
            first_moment.count for first_moment in TRAYS[number].species
        ]


def test_trays_with_the_same_beads_differ():
    scene_moment = film(scene=replace(SMALL, trays=(2, 3))).at(9, 0)
    assert not np.array_equal(scene_moment.beads[0].velocities, scene_moment.beads[1].velocities)


def test_one_tray_may_have_other_settings():
    elastic = replace(SHAKEN, restitution=1.0, wall_restitution=1.0, seed=99, first_shake=0.2)
    moment = SceneFilm(SHAKEN, SMALL, gases={3: elastic}).at(9, 0)
    alone, same = film().at(9, 0).beads
    np.testing.assert_array_equal(moment.beads[0].velocities, alone.velocities)
    gas = ShakenTray(
        replace(SHAKEN, tray=3, restitution=1.0, wall_restitution=1.0), TRAYS[3], run=3
    )
    np.testing.assert_array_equal(moment.beads[1].velocities, gas.at(0.3)[1])
    assert not np.array_equal(moment.beads[1].velocities, same.velocities)


def test_positions_are_relative_to_the_floor_of_the_swinging_tray():
    first_moment = film(scene=SWINGING).at(14, 0)
    still = film(scene=replace(SWINGING, swing_knocks=False)).at(14, 0)
    at_rest = film(scene=SMALL).at(14, 0)
    for beads, unknocked, resting in zip(
        first_moment.beads, still.beads, at_rest.beads, strict=True
    ):
        assert 1e-5 < np.hypot(*beads.displacement) < 2e-4
        # Without knocks the gas is that of a plate at rest, seen from the moving floor.
        np.testing.assert_allclose(
            unknocked.positions[:, :2] + unknocked.displacement, resting.positions[:, :2]
        )
        np.testing.assert_allclose(unknocked.free_velocities, resting.velocities, atol=1e-15)
        # With them no bead reaches into a wall.
        low = beads.positions - beads.radii[:, np.newaxis]
        high = beads.positions + beads.radii[:, np.newaxis]
        assert (low > -1e-9).all()
        assert (high < np.array(TRAYS[beads.tray].dimensions) + 1e-9).all()


def test_beads_fly_straight_past_a_swinging_plate():
    moving = film(scene=SWINGING)
    before, after = moving.at(5, 0).beads[0], moving.at(6, 0).beads[0]
    interval = 1.0 / SHAKEN.frame_rate
    free = np.all(before.free_velocities == after.free_velocities, axis=1)
    assert free.sum() >= 5
    travelled = after.positions[:, :2] + after.displacement
    travelled = travelled - before.positions[:, :2] - before.displacement
    np.testing.assert_allclose(
        travelled[free], interval * before.free_velocities[free, :2], atol=1e-12
    )


def test_the_swing_is_a_damped_sine_that_ends_before_the_next_shaking_event():
    scene = replace(SWINGING, swing_direction=0.0, swing_frequency=2.0, swing_damping=0.2)
    motion = wall_motion_of(SHAKEN, scene)
    for since in (0.0, 0.125, 3.1, 20.0):
        scene_moment = plate_motion(motion, since)
        expected = 2e-4 * math.exp(-0.2 * since) * math.sin(4.0 * math.pi * since)
        assert scene_moment.displacement == pytest.approx((expected, 0.0), abs=1e-15)
        if since > 0.0:
            ahead, behind = (
                plate_motion(motion, since + step).displacement[0] for step in (1e-6, -1e-6)
            )
            slope = (ahead - behind) / 2e-6
            assert scene_moment.velocity[0] == pytest.approx(slope, rel=1e-5)
    assert plate_motion(motion, None).displacement == (0.0, 0.0)
    assert plate_motion(motion, 60.0).displacement == (0.0, 0.0)
    assert motion.end <= SHAKEN.shake_period
    assert math.sin(motion.angular_frequency * motion.end) == pytest.approx(0.0, abs=1e-9)


def test_the_plate_comes_through_several_shaking_events():
    shaken = replace(SHAKEN, shake_period=0.5)
    moving = film(shaken, replace(SWINGING, swing_frequency=4.0, swing_damping=0.0, trays=(1,)))
    cycles = [moving.at(k, 0).beads[0].cycle for k in range(0, 36, 5)]
    assert cycles == [0, 1, 1, 1, 2, 2, 2, 3]


def test_clusters_are_in_the_truth():
    sticky = replace(SHAKEN, sticking_speed=0.02, first_shake=0.0)
    scene_moment = film(sticky, replace(SMALL, trays=(3,))).at(60, 0)
    bodies = scene_moment.beads[0].bodies
    assert scene_moment.trays[0].bodies == np.unique(bodies).size < bodies.size
    stuck = np.flatnonzero(bodies != np.arange(bodies.size))
    first_moment = stuck[0]
    mates = np.flatnonzero(bodies == bodies[first_moment])
    gaps = np.linalg.norm(
        scene_moment.beads[0].positions[mates] - scene_moment.beads[0].positions[first_moment],
        axis=1,
    ) - (scene_moment.beads[0].radii[mates] + scene_moment.beads[0].radii[first_moment])
    assert np.sort(np.abs(gaps))[0] < 1e-9


def test_a_film_is_the_same_every_time_and_a_frame_needs_none_before_it():
    scene = replace(SceneSettings(), pixels_per_metre=7500.0, trays=(2,))
    images = [moment.frame.image for moment in film(scene=scene).moments(8)]
    alone = film(scene=scene).at(7, 0).frame.image
    np.testing.assert_array_equal(alone, images[7])
    assert not np.array_equal(images[6], images[7])
    other_seed = film(replace(SHAKEN, seed=2), scene).at(7, 0).frame.image
    assert not np.array_equal(alone, other_seed)


def test_stamps_are_those_of_the_frame_rate():
    moments = list(film(scene=replace(SMALL, trays=(1,))).moments(3, 5))
    assert [moment.frame.stamp_ns for moment in moments] == [5, 33_333_338, 66_666_672]
    assert all(moment.frame.encoding == 'bgr8' for moment in moments)
    assert not moments[0].frame.image.flags.writeable


def test_no_effects_means_all_strengths_zero_but_shading():
    bare = without_effects(SceneSettings(shading=0.5))
    off = {row.name for row in rows(bare) if row.default == 0.0 and row.default is not False}
    assert off == {
        'fisheye', 'defocus_px', 'noise', 'vignetting', 'gradient', 'flicker', 'shadows', 'chalk',
        'glare', 'ovality', 'irregularity', 'turning', 'swing', 'floor_texture', 'rim_width',
        'camera_height', 'exposure', 'camera_jitter_px', 'camera_sway_px',
    }  # fmt: skip
    assert bare.shading == 0.5


def test_scenes_that_cannot_be_filmed_are_refused():
    with pytest.raises(ConfigurationError, match=r'noise: -1.0 is outside \[0, 64\]; glare: nan'):
        SceneFilm(SHAKEN, replace(SMALL, noise=-1.0, glare=math.nan))
    with pytest.raises(ConfigurationError, match='is empty or has duplicates'):
        SceneFilm(SHAKEN, replace(SMALL, trays=(1, 1)))
    with pytest.raises(ConfigurationError, match='has no place on the plate'):
        SceneFilm(SHAKEN, replace(SMALL, trays=(1,)), {1: replace(TRAYS[1], place=None)})
    with pytest.raises(ConfigurationError, match='tray 3: does not exist'):
        SceneFilm(SHAKEN, SMALL, {1: TRAYS[1]})
    with pytest.raises(ConfigurationError, match=r'swing: 0.002 m is 15 px .* less than 0.002 m'):
        SceneFilm(SHAKEN, replace(SMALL, swing=0.002))
    with pytest.raises(ConfigurationError, match='but beads cannot stick to walls'):
        SceneFilm(replace(SHAKEN, wall_sticking_speed=0.001), SWINGING)
    with pytest.raises(SimulationError, match='frames: -1'):
        film(scene=replace(SMALL, trays=(1,))).moments(-1)
