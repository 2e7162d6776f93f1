"""Cameras drawn at random: ranges, repeatability, and pictures of what is drawn."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from scenes import TRAYS

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.plate_scene.drawn_camera import CameraRanges, drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.simulation.plate_scene.scene_checks import check_motion, check_scene

GAS = SimulationSettings(seed=3, first_shake=0.0)


def test_a_camera_is_drawn_from_its_seed_alone():
    assert drawn_camera(5, TRAYS[3], GAS) == drawn_camera(5, TRAYS[3], GAS)
    assert drawn_camera(5, TRAYS[3], GAS).scene != drawn_camera(6, TRAYS[3], GAS).scene
    other_gas = drawn_camera(5, TRAYS[3], replace(GAS, seed=9, restitution=0.7))
    assert other_gas.scene == drawn_camera(5, TRAYS[3], GAS).scene
    # A range that is changed leaves the other draws as they were.
    sharp = drawn_camera(5, TRAYS[3], GAS, ranges=CameraRanges(defocus_px=(0.0, 0.1)))
    assert replace(sharp.scene, defocus_px=1.0) == replace(
        drawn_camera(5, TRAYS[3], GAS).scene, defocus_px=1.0
    )


def test_draws_fill_their_ranges_and_can_be_filmed():
    cameras = [drawn_camera(seed, TRAYS[1 + 2 * (seed % 4)], GAS) for seed in range(300)]
    ranges = CameraRanges()
    scenes = [camera.scene for camera in cameras]
    for camera in cameras:
        check_scene(camera.scene)
        check_motion(camera.simulation, camera.scene)
        assert camera.simulation.width_px % 2 == camera.simulation.height_px % 2 == 0
    for name in {field.name for field in fields(ranges)} & {
        field.name for field in fields(scenes[0])
    } - {'camera_height', 'swing'}:
        low, high = getattr(ranges, name)
        values = np.array([getattr(scene, name) for scene in scenes])
        assert low <= values.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < values.max() <= high
    scales = np.array([scene.pixels_per_metre for scene in scenes])
    assert 6000.0 <= scales.min() < 6500.0
    assert 23000.0 < scales.max() <= 25000.0
    assert {camera.compression.codec for camera in cameras} == {'jpeg', 'h264_crf'}
    assert {camera.compression.crf for camera in cameras} == set(range(18, 29))
    assert {scene.bayer for scene in scenes} == {'none', 'rggb', 'grbg', 'gbrg', 'bggr'}
    rates = {camera.simulation.frame_rate for camera in cameras}
    assert min(rates) == 15.0
    assert max(rates) == 120.0


def test_a_fifth_of_the_cameras_moves():
    def moving(part):
        scenes = [drawn_camera(seed, TRAYS[1], GAS, moving=part).scene for seed in range(400)]
        return np.mean([s.camera_jitter_px > 0.0 or s.camera_sway_px > 0.0 for s in scenes])

    assert moving(0.2) == pytest.approx(0.2, abs=0.06)
    assert moving(0.0) == 0.0
    assert moving(1.0) == 1.0


def test_half_of_the_plates_swing_and_half_of_the_cameras_are_near():
    scenes = [drawn_camera(seed, TRAYS[1], GAS).scene for seed in range(400)]
    assert np.mean([scene.swing > 0.0 for scene in scenes]) == pytest.approx(0.5, abs=0.08)
    assert np.mean([scene.camera_height > 0.0 for scene in scenes]) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize(('tray', 'seed'), [(1, 1), (3, 2), (5, 3), (7, 4)])
def test_what_is_drawn_shows_the_tray_its_rim_and_what_is_around(tray, seed):
    camera = drawn_camera(seed, TRAYS[tray], GAS, moving=1.0)
    film = SceneFilm(camera.simulation, camera.scene, {tray: TRAYS[tray]})
    first, second = (film.at(number, number) for number in (0, 2))
    image = first.frame.image
    assert image.shape == (camera.simulation.height_px, camera.simulation.width_px, 3)
    x, y, width, height = film.camera.geometry.regions[tray]
    rim = camera.scene.rim_width * camera.scene.pixels_per_metre
    assert min(x, y) > rim + 19.0
    floor = image[y : y + height, x : x + width].astype(float)
    # Beads stand out from the floor by their colour.
    assert floor.std() > 8.0
    assert not np.array_equal(image, second.frame.image)
    assert first.shift_px != second.shift_px


def test_ranges_in_the_wrong_order_are_refused():
    with pytest.raises(ConfigurationError, match=r'noise \(4.0, 1.0\)'):
        drawn_camera(1, TRAYS[1], GAS, ranges=CameraRanges(noise=(4.0, 1.0)))
