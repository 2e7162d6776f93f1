"""Every effect of a camera that varies, seen in pixels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes import NEAR, NEAR_SIMULATION, PLAIN, TRAYS, empty_camera, near_camera
from scipy.ndimage import map_coordinates
from scipy.optimize import least_squares

from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.plate_scene.optics.camera_shake import CameraShake
from nanorocks_ros.simulation.plate_scene.optics.perspective import seen_spheres
from nanorocks_ros.simulation.plate_scene.optics.raw_sensor import through_filters
from nanorocks_ros.simulation.plate_scene.optics.shutter import (
    MOST,
    grouped_path,
    instants_for,
    shutter_times,
)
from nanorocks_ros.simulation.plate_scene.plate_camera import Instant
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm

SCALE = NEAR.pixels_per_metre
RADIUS = 0.001
PLACE = np.array([0.0062, 0.0071, 0.0013])
FLAT = replace(NEAR, shading=0.0, highlights=0.0)


def covered(scene, *places, shift=(0.0, 0.0)):
    """Share of every pixel that a flat bead covers, on average over some places of it."""
    camera = near_camera(scene)
    instants = [Instant({1: place[np.newaxis]}, (0.0, 0.0), shift, shift) for place in places]
    away = np.array([[0.0135, 0.0135, 0.001]])
    empty = [Instant({1: away}, (0.0, 0.0), shift, shift)]
    seen, ground = (camera.exposed(i, 0).astype(float)[..., 1] for i in (instants, empty))
    y, x = np.mgrid[0.5 : seen.shape[0], 0.5 : seen.shape[1]]
    column, row = camera.geometry.rectified(1, places[0][np.newaxis])[0]
    colour = seen[np.hypot(x - column, y - row) < 0.5 * RADIUS * SCALE].mean()
    share = (ground - seen) / np.maximum(ground - colour, 1.0)
    near = np.hypot(x - column, y - row) < 3.0 * RADIUS * SCALE
    return np.where(near & (np.abs(share) > 0.02), share, 0.0), (column, row), x, y


def moments(share, x, y):
    """Middle and radius of the disc of the same area."""
    total = share.sum()
    return (share * x).sum() / total, (share * y).sum() / total, math.sqrt(total / math.pi)


@pytest.mark.parametrize('defocus', [0.0, 0.8, 1.5])
@pytest.mark.parametrize('diameter_px', [12.0, 27.0, 50.0])
def test_the_outline_of_a_bead_is_exact_whatever_the_blur(defocus, diameter_px):
    scale = diameter_px / 0.002
    scene = replace(FLAT, defocus_px=defocus, pixels_per_metre=scale)
    size = SimulationSettings(
        width_px=2 * round(0.009 * scale), height_px=2 * round(0.009 * scale)
    )
    camera = near_camera(scene, size)
    place, away = PLACE[np.newaxis], np.array([[0.0135, 0.0135, 0.001]])
    seen, ground = (camera.picture({1: p}, 0).astype(float)[..., 1] for p in (place, away))
    column, row = camera.geometry.rectified(1, place)[0]
    rows, columns = (slice(round(c - diameter_px), round(c + diameter_px)) for c in (row, column))
    y, x = np.mgrid[0.5 : seen.shape[0], 0.5 : seen.shape[1]][:, rows, columns]
    seen, ground = seen[rows, columns], ground[rows, columns]

    def differences(values):
        across, down, radius, width, level = values
        beyond = (radius - np.hypot(x - across, y - down)) / width
        share = 0.5 * (1.0 + np.tanh(beyond))
        return (ground + share * (level - ground) - seen).ravel()

    fit = least_squares(differences, (column, row, 0.5 * diameter_px, 1.0, 30.0)).x
    assert fit[:2] == pytest.approx((column, row), abs=0.02)
    # A Gaussian of variance s^2 moves the half level of a disc inwards by s^2 / 2 r.
    variance = 0.36**2 + defocus**2
    assert fit[2] == pytest.approx(0.5 * diameter_px - defocus**2 / diameter_px, abs=0.02)
    assert 0.2 < fit[3] ** 2 / variance < 6.0


def test_light_falls_from_the_lamp():
    for azimuth in (-2.2, -0.7, 0.8, 2.4):
        lit = replace(NEAR, lamp_azimuth=azimuth, lamp_elevation=0.9, shadows=0.4)
        camera = near_camera(lit)
        picture = camera.picture({1: PLACE[np.newaxis]}, 0).astype(float)
        dark = near_camera(replace(lit, shadows=0.0)).picture({1: PLACE[np.newaxis]}, 0)
        column, row = camera.geometry.rectified(1, PLACE[np.newaxis])[0]
        y, x = np.mgrid[0.5 : picture.shape[0], 0.5 : picture.shape[1]]
        bead = np.hypot(x - column, y - row) < 0.9 * RADIUS * SCALE
        green = np.where(bead, picture[..., 1], 0.0)
        light = np.where(green > green.max() - 10.0, 1.0, 0.0)
        highlight = math.atan2((light * (y - row)).sum(), (light * (x - column)).sum())
        assert math.cos(highlight - azimuth) > 0.97
        shadow = np.maximum(dark[..., 1].astype(float) - picture[..., 1] - 2.0, 0.0)
        away = math.atan2((shadow * (y - row)).sum(), (shadow * (x - column)).sum())
        assert math.cos(away - azimuth) < -0.97
    with_none = near_camera(replace(NEAR, highlights=0.0)).picture({1: PLACE[np.newaxis]}, 0)
    with_highlights = near_camera(NEAR).picture({1: PLACE[np.newaxis]}, 0)
    assert with_highlights[..., 1].astype(int).max() >= with_none[..., 1].max()


def test_a_lower_lamp_throws_longer_shadows():
    reach = []
    for elevation in (1.2, 0.7):
        pictures = [
            near_camera(replace(NEAR, shadows=s, lamp_elevation=elevation)).picture(
                {1: PLACE[np.newaxis]}, 0
            )
            for s in (0.0, 0.4)
        ]
        lost = pictures[0][..., 1].astype(float) - pictures[1][..., 1]
        reach.append(np.argwhere(lost > 4.0).max())
    assert reach[1] > reach[0] + 4


def test_exposure_blurs_along_the_path_and_around_the_stamp():
    path = np.array([0.0006, 0.0, 0.0])
    places = [PLACE + path * step for step in np.linspace(-0.5, 0.5, 15)]
    still = covered(FLAT, PLACE)
    share, (column, row), x, y = covered(FLAT, *places)
    # `covered` looks around its first place.
    column += 0.5 * path[0] * SCALE
    across, down, _ = moments(share, x, y)
    assert (across, down) == pytest.approx((column, row), abs=0.03)
    widths = [np.ptp(x[s > 0.5]) for s in (still[0], share)]
    heights = [np.ptp(y[s > 0.5]) for s in (still[0], share)]
    partly = [np.count_nonzero((s > 0.1) & (s < 0.9)) for s in (still[0], share)]
    assert heights[0] == heights[1]
    assert abs(widths[0] - widths[1]) <= 2.0
    assert partly[1] > 2.0 * partly[0]


def test_instants_fill_the_exposure_evenly_around_the_stamp():
    for instants in (1, 3, 9):
        before, after = shutter_times(2.0, 0.03, instants)
        times = np.array([*before, 2.0, *after])
        assert len(times) == instants
        assert times.mean() == pytest.approx(2.0, abs=1e-12)
        assert np.ptp(times) == pytest.approx(0.03 * (1.0 - 1.0 / instants), abs=1e-12)
    assert shutter_times(0.0, 0.03, 3)[0] == (0.0,)
    assert [instants_for(path) for path in (0.0, 1.0, 2.5, 1e3)] == [1, 1, 5, MOST]


def test_a_plate_that_is_drawn_less_often_keeps_its_mean_place():
    path = np.linspace([0.0, 0.0], [1.0, 0.5], 9)
    grouped = grouped_path(path)
    assert grouped.mean(axis=0) == pytest.approx(path.mean(axis=0))
    assert 2 <= len(np.unique(grouped, axis=0)) <= 4
    assert len(np.unique(grouped_path(np.zeros((5, 2))), axis=0)) == 1


def test_filters_of_colour_leave_one_value_a_pixel_and_the_place_of_edges():
    picture = np.zeros((40, 60, 3), dtype=np.uint8)
    picture[:, 30:] = (50, 100, 150)
    for pattern in ('rggb', 'grbg', 'gbrg', 'bggr'):
        seen = through_filters(picture, pattern)
        assert (seen[8:-8, 40:-8] == (50, 100, 150)).all()
        assert not seen[8:-8, 8:20].any()
        for channel, level in enumerate((50, 100, 150)):
            edge = 60.0 - seen[8:-8, :, channel].astype(float).mean(axis=0).sum() / level
            assert edge == pytest.approx(30.0, abs=0.51)
    noisy = replace(FLAT, noise=4.0)
    colours = [
        near_camera(replace(noisy, bayer=pattern)).picture({1: PLACE[np.newaxis]}, 0)
        for pattern in ('none', 'rggb')
    ]
    corner = [picture[5:40, 5:290].astype(float) for picture in colours]
    neighbours = [
        np.corrcoef(c[:, 1:-1:2, 2].ravel(), c[:, 2::2, 2].ravel())[0, 1] for c in corner
    ]
    assert neighbours[0] < neighbours[1] - 0.2


def test_perspective_is_that_of_a_cone_around_the_sphere():
    height, radius = 2000.0, 30.0
    point, axis = np.array([[420.0, -130.0]]), np.array([20.0, 10.0])
    seen = seen_spheres(point, np.array([70.0]), np.array([radius]), axis, height)
    # Rays to points of the outline touch the sphere.
    centre = np.array([*(point[0] - axis), height - 70.0])
    for angle in np.linspace(0.0, 6.0, 7):
        unit = np.array([math.cos(angle), math.sin(angle)])
        outline = seen.centres[0] + radius * seen.stretch[0] @ unit - axis
        ray = np.array([*outline, height])
        distance = np.linalg.norm(np.cross(centre, ray)) / np.linalg.norm(ray)
        assert distance == pytest.approx(radius, abs=1e-9)
    with pytest.raises(SimulationError, match='camera_height'):
        seen_spheres(point, np.array([1990.0]), np.array([radius]), axis, height)


def test_a_near_camera_draws_higher_beads_larger_and_further_out():
    scene = replace(FLAT, camera_height=0.15)
    drawn = []
    for z in (0.001, 0.002):
        place = np.array([0.0030, 0.0050, z])
        share, _, x, y = covered(scene, place)
        drawn.append(moments(share, x, y))
        expected = seen_spheres(
            near_camera(scene).geometry.rectified(1, place[np.newaxis]),
            np.array([z * SCALE]),
            np.array([RADIUS * SCALE]),
            np.array([152.0, 152.0]),
            0.15 * SCALE,
        )
        size = math.sqrt(np.linalg.det(expected.stretch[0])) * RADIUS * SCALE
        assert drawn[-1][:2] == pytest.approx(tuple(expected.centres[0]), abs=0.05)
        assert drawn[-1][2] == pytest.approx(size, rel=0.01)
    assert drawn[1][0] < drawn[0][0] - 0.3
    assert drawn[1][2] > drawn[0][2] * 1.004


def test_jitter_is_white_and_sway_is_slow():
    scene = replace(NEAR, camera_jitter_px=1.5)
    shake = CameraShake(scene, 4)
    shifts = np.array([shake.shift(number, number / 30.0) for number in range(4000)])
    assert shifts.std(axis=0) == pytest.approx([1.5, 1.5], rel=0.05)
    assert abs(np.corrcoef(shifts[1:, 0], shifts[:-1, 0])[0, 1]) < 0.05
    assert abs(np.corrcoef(*shifts.T)[0, 1]) < 0.05
    sway = CameraShake(
        replace(NEAR, camera_sway_px=2.0, camera_sway_frequency=0.5, camera_sway_direction=0.3), 4
    )
    path = np.array([sway.shift(0, time) for time in np.arange(0.0, 4.0, 0.01)])
    assert np.hypot(*path.T).max() == pytest.approx(2.0, abs=0.01)
    assert path[0] == pytest.approx(path[200], abs=1e-9)
    assert np.arctan2(path[:, 1], path[:, 0])[np.hypot(*path.T) > 1.0] % math.pi == pytest.approx(
        0.3, abs=1e-9
    )


def test_the_camera_moves_beads_tray_and_surroundings_alike():
    scene = replace(FLAT, rim_width=0.0012, floor_texture=0.06, defocus_px=1.0)
    camera, shift = near_camera(scene), (1.37, -2.61)
    place = {1: PLACE[np.newaxis]}
    still = camera.exposed([Instant(place, (0.0, 0.0))], 0).astype(float)
    moved = camera.exposed([Instant(place, (0.0, 0.0), shift, shift)], 0).astype(float)
    for part in (np.s_[4:30, 20:280], np.s_[100:130, 60:260], np.s_[40:260, 20:60]):
        assert measured_shift(still, moved, part) == pytest.approx(shift, abs=0.05)


def test_the_whole_plate_has_the_lamp_the_rim_and_the_motion_of_the_camera():
    plain = replace(PLAIN, defocus_px=1.0)
    still, shift = Instant({}, (0.0, 0.0)), (1.37, -2.61)
    camera = empty_camera(plain)
    first = camera.exposed([still], 0).astype(float)
    moved = camera.exposed([still._replace(shift=shift, plate_shift=shift)], 0).astype(float)
    x, y, width, height = camera.geometry.regions[1]
    part = np.s_[y - 10 : y + height + 10, x - 10 : x + width + 10]
    assert measured_shift(first, moved, part) == pytest.approx(shift, abs=0.05)
    away = empty_camera(replace(plain, lamp_azimuth=plain.lamp_azimuth + math.pi))
    middle = slice(y + 20, y + height - 20)
    chamfers = [(middle, slice(x - 3, x - 1)), (middle, slice(x + width + 1, x + width + 3))]
    turned = away.exposed([still], 0).astype(float)
    lit = [[picture[chamfer].mean() for chamfer in chamfers] for picture in (first, turned)]
    assert lit[0][0] < lit[0][1] - 20.0
    assert lit[1][0] > lit[1][1] + 20.0
    rim = empty_camera(replace(plain, rim_width=0.001, rim_shade=0.3)).exposed([still], 0)
    assert rim[middle, x - 7 : x - 2].mean() < 0.5 * first[middle, x - 7 : x - 4].mean()
    swung = [Instant({}, (step * 1e-4, 0.0)) for step in (-1.0, 0.0, 1.0)]
    blurred = camera.exposed(swung, 0).astype(float)
    edge = np.s_[y + 20 : y + height - 20, x + width - 6 : x + width + 6]
    sharpness = [np.abs(np.diff(picture[edge], axis=1)).max() for picture in (first, blurred)]
    assert sharpness[1] < 0.9 * sharpness[0]


def test_glare_moves_with_the_camera():
    glaring = replace(PLAIN, glare=1.0)
    camera = empty_camera(glaring)
    still = Instant({}, (0.0, 0.0))
    first, moved = (
        camera.exposed([still._replace(shift=shift, plate_shift=shift)], 0)[..., 1]
        for shift in ((0.0, 0.0), (3.0, -2.0))
    )
    cores = [np.argwhere(picture > 250).mean(axis=0) for picture in (first, moved)]
    assert cores[1] - cores[0] == pytest.approx((-2.0, 3.0), abs=0.05)


def measured_shift(still, moved, part):
    """Shift of a part of a picture, by least squares over its gradient in small steps."""
    shift = np.array([1.0, -3.0])
    rows, columns = part
    y, x = np.mgrid[rows, columns].astype(float)
    for _ in range(30):
        at = [y - shift[1], x - shift[0]]
        seen = map_coordinates(still[..., 1], at, order=3)
        down, across = np.gradient(still[..., 1])
        slopes = [map_coordinates(slope, at, order=1).ravel() for slope in (across, down)]
        wrong = (moved[..., 1][part] - seen).ravel()
        shift -= np.linalg.lstsq(np.stack(slopes).T, wrong, rcond=None)[0]
    return tuple(shift)


def test_an_open_shutter_changes_pictures_and_not_the_truth():
    gas = replace(NEAR_SIMULATION, first_shake=0.1, mean_speed=0.02, frame_rate=25.0)
    scene = replace(NEAR, swing=0.0002)
    films = [
        SceneFilm(gas, replace(scene, exposure=part), {1: TRAYS[1]}).moments(8)
        for part in (0.0, 0.9)
    ]
    for number, (sharp, blurred) in enumerate(zip(*films, strict=True)):
        for sharp_truth, truth in zip(sharp.beads, blurred.beads, strict=True):
            assert truth.cycle == sharp_truth.cycle
            assert truth.positions == pytest.approx(sharp_truth.positions, abs=1e-12)
            assert truth.velocities == pytest.approx(sharp_truth.velocities, abs=1e-12)
        assert blurred.trays[0].mean_speed == pytest.approx(sharp.trays[0].mean_speed, abs=1e-12)
        same = np.array_equal(sharp.frame.image, blurred.frame.image)
        # The shutter of frame 2 (80 ms) is open from 62 to 98 ms, before the shaking event.
        assert same == (number <= 2)


def test_what_cannot_be_drawn_is_refused():
    for changed, message in (
        ({'fisheye': 0.3}, 'close_up: through a fisheye lens'),
        ({'trays': (1, 3)}, 'close_up: of the trays'),
        ({'pixels_per_metre': 25000.0}, 'tray 1: 375 x 375 px'),
        ({'camera_height': 0.004}, 'camera_height: 0.004 m is within'),
        ({'camera_height': 0.2, 'close_up': False}, 'whole plate is drawn without perspective'),
        ({'camera_jitter_px': 6.0}, 'camera_jitter_px: 6 px'),
    ):
        with pytest.raises(ConfigurationError, match=message):
            SceneFilm(NEAR_SIMULATION, replace(NEAR, **changed), TRAYS)
