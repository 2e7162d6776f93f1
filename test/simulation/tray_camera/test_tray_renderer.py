"""Pictures of a tray: positions, sizes and noise of the beads."""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
import pytest
from small_gases import acrylic, tray_of

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.bead_drawing import draw_bead
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera

TRAY = load_trays()[1]
QUIET = SimulationSettings(width_px=320, height_px=260, noise=0.0)

# CRC-32 of the first three frames of trays 1 and 5.
GOLDEN = [[990521238, 1185101211, 3693857205], [4107039885, 275514773, 2393055752]]


def camera_of(settings, count=1, material='acrylic', radius=0.001):
    radii = np.full(count, radius)
    return TrayCamera(settings, TRAY, radii, (material,) * count)


def crop(camera, picture):
    x, y, width, height = camera.region
    return picture[y : y + height, x : x + width].astype(float)


def covered(radius, column, row, width=1.6):
    """Share of each pixel that a disc covers, from a drawing in one flat colour."""
    canvas = np.zeros((60, 60, 3), np.float32)
    flat = np.array([100.0, 100.0, 100.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    draw_bead(canvas, np.array([column, row, radius]), flat, width)
    return canvas[:, :, 0].astype(float) / 100.0


@pytest.mark.parametrize('radius', [3.5, 13.5, 20.0])
@pytest.mark.parametrize('column', [30.0, 30.25, 30.5, 30.87])
@pytest.mark.parametrize('row', [29.9, 30.4])
def test_a_disc_has_its_area_and_its_centre_to_a_hundredth_of_a_pixel(radius, column, row):
    share = covered(radius, column, row)
    y, x = np.mgrid[0.5:60.0, 0.5:60.0]
    assert np.sum(share * x) / share.sum() == pytest.approx(column, abs=0.01)
    assert np.sum(share * y) / share.sum() == pytest.approx(row, abs=0.01)
    assert np.sqrt(share.sum() / np.pi) == pytest.approx(radius, abs=0.03)


def pixels_of(camera, positions):
    """Columns and rows of points of the tray, (n, 2); columns follow x, rows follow y."""
    return positions[:, :2] * QUIET.pixels_per_metre + camera.region[:2]


@pytest.mark.parametrize('place', [(0.0075, 0.0075), (0.00412, 0.01123), (0.0031, 0.0049)])
@pytest.mark.parametrize('material', sorted(known_materials()))
def test_a_bead_in_a_picture_is_where_and_as_large_as_it_should_be(place, material):
    camera = camera_of(QUIET, material=material)
    position = np.array([[*place, 0.0015]])
    elsewhere = np.array([[0.015 - place[0] + 0.003, 0.0128, 0.0015]])
    at_place, elsewhere_crop = (crop(camera, camera.picture(p, 0)) for p in (position, elsewhere))
    change = np.abs(at_place - elsewhere_crop).max(axis=2)
    column, row = pixels_of(camera, position)[0] - np.array(camera.region[:2])
    near = (
        np.hypot(*(np.mgrid[0.5:202.0, 0.5:202.0] - np.array([row, column])[:, None, None])) < 20
    )
    mask = (change > 3) & near
    rows, columns = np.nonzero(mask)
    assert columns.mean() + 0.5 == pytest.approx(column, abs=0.25)
    assert rows.mean() + 0.5 == pytest.approx(row, abs=0.25)
    assert np.sqrt(mask.sum() / np.pi) == pytest.approx(13.5, abs=0.9)


def test_the_region_is_the_tray_centred_in_the_picture():
    camera = camera_of(SimulationSettings())
    assert camera.region == ((1920 - 202) // 2, (1080 - 202) // 2, 202, 202)
    assert camera.picture(np.full((1, 3), 0.0075), 0).shape == (1080, 1920, 3)
    wide = TrayCamera(SimulationSettings(), load_trays()[3], np.array([0.001]), ('glass',))
    assert wide.region == ((1920 - 432) // 2, (1080 - 135) // 2, 432, 135)


def test_the_upper_bead_hides_the_lower_one():
    tray = load_trays()[5]
    low, high = [0.007, 0.005, 0.0006], [0.007, 0.005, 0.0024]
    settings = replace(QUIET, width_px=480)
    camera = TrayCamera(settings, tray, np.array([0.0005, 0.0005]), ('glass', 'copper'))
    column, row = pixels_of(camera, np.array([low]))[0].astype(int)
    blue, _, red = camera.picture(np.array([high, low]), 0)[row, column].astype(int)
    assert blue > red + 40
    blue, _, red = camera.picture(np.array([low, high]), 0)[row, column].astype(int)
    assert red > blue + 40


def test_beads_differ_from_the_floor_and_from_each_other_in_colour():
    mean = {}
    for material in known_materials():
        camera = camera_of(QUIET, material=material)
        column, row = pixels_of(camera, np.full((1, 2), 0.0075))[0].astype(int)
        picture = camera.picture(np.full((1, 3), 0.0075), 0)
        mean[material] = picture[row - 9 : row + 9, column - 9 : column + 9].mean(axis=(0, 1))
    assert mean['acrylic'][2] > 2 * mean['acrylic'][0]
    assert mean['glass'][0] > 2 * mean['glass'][2]
    assert mean['copper'][2] > mean['copper'][1] > mean['copper'][0]


@pytest.mark.parametrize('noise', [0.5, 2.0, 6.0])
def test_the_noise_has_the_standard_deviation_asked_for(noise):
    camera = camera_of(replace(QUIET, noise=noise))
    beads = np.full((1, 3), 0.0075)
    pictures = np.stack([camera.picture(beads, k) for k in range(40)]).astype(float)
    deviation = pictures.std(axis=0, ddof=1)
    # Rounding to whole gray levels adds 1/12.
    expected = np.sqrt(noise**2 + 1.0 / 12.0)
    inside = np.sqrt(np.mean(crop(camera, deviation) ** 2))
    assert inside == pytest.approx(expected, rel=0.02)
    outside = np.sqrt(np.mean(deviation[:20] ** 2))
    # The plate is of one even gray: there rounding of weak noise adds not quite 1/12.
    assert outside == pytest.approx(expected, rel=0.05)


def test_the_noise_is_independent_of_neighbours_channels_and_frames():
    camera = camera_of(replace(QUIET, noise=5.0))
    beads = np.full((1, 3), 0.0075)
    first, second = (crop(camera, camera.picture(beads, k)) for k in (0, 1))
    third, fourth = (crop(camera, camera.picture(beads, k)) for k in (2, 3))
    change, later = second - first, fourth - third
    variance = change.var()

    def correlation(a, b):
        return abs(np.mean(a * b) / variance)

    assert correlation(change, later) < 0.02
    assert correlation(change[:, 1:], change[:, :-1]) < 0.02
    assert correlation(change[1:], change[:-1]) < 0.02
    assert correlation(change[:, :, 0], change[:, :, 1]) < 0.02


def test_a_frame_is_the_same_in_whatever_order_frames_are_drawn():
    settings = replace(QUIET, noise=2.0)
    beads = np.full((1, 3), 0.0075)
    forward, backward = camera_of(settings), camera_of(settings)
    expected = [forward.picture(beads, k) for k in range(4)]
    for k in (3, 1, 2, 0):
        np.testing.assert_array_equal(backward.picture(beads, k), expected[k])
    assert not np.array_equal(expected[0], expected[1])


def test_without_noise_nothing_moves_but_the_beads():
    camera = camera_of(QUIET)
    beads = np.full((1, 3), 0.0075)
    np.testing.assert_array_equal(camera.picture(beads, 0), camera.picture(beads, 1))


def test_frames_are_the_same_on_every_machine():
    checksums = []
    for number in (1, 5):
        settings = SimulationSettings(first_shake=0.0, tray=number, width_px=640, height_px=480)
        frames = film(settings, load_trays()[number], 3)
        checksums.append([zlib.crc32(frame.image.tobytes()) for frame, _ in frames])
    assert checksums == GOLDEN


def test_another_seed_gives_other_frames():
    first_frame, second_frame = (
        next(film(SimulationSettings(seed=seed), TRAY, 1))[0].image for seed in (1, 2)
    )
    assert not np.array_equal(first_frame, second_frame)


def test_a_film_pairs_each_frame_with_its_truth():
    moments = list(film(SimulationSettings(), TRAY, 3, start_stamp_ns=5))
    assert [frame.stamp_ns for frame, _ in moments] == [5, 33_333_338, 66_666_672]
    for frame, truth in moments:
        assert frame.stamp_ns == truth.stamp_ns
        assert frame.encoding == 'bgr8'
        assert frame.image.shape == (1080, 1920, 3)
        assert frame.image.dtype == np.uint8
        assert not frame.image.flags.writeable


def test_a_film_shows_what_the_shaken_tray_does():
    settings = replace(QUIET, noise=2.0, first_shake=0.0)
    shaken = ShakenTray(settings, TRAY)
    camera = TrayCamera(settings, TRAY, shaken.radii, shaken.materials)
    for k, (moment, (frame, _)) in enumerate(
        zip(shaken.moments(5), film(settings, TRAY, 5), strict=True)
    ):
        np.testing.assert_array_equal(camera.picture(moment.positions, k), frame.image)


def test_a_tray_that_fills_the_picture_has_no_surroundings():
    settings = replace(QUIET, width_px=202, height_px=202)
    camera = camera_of(settings)
    assert camera.region == (0, 0, 202, 202)
    assert camera.picture(np.full((1, 3), 0.0075), 0).shape == (202, 202, 3)


def test_invalid_input_of_the_camera_is_refused():
    with pytest.raises(SimulationError, match='202 x 202 px in a picture of 200 x 260'):
        camera_of(replace(QUIET, width_px=200))
    with pytest.raises(SimulationError, match='materials: 1 of them'):
        TrayCamera(QUIET, TRAY, np.full(2, 0.001), ('glass',))
    with pytest.raises(SimulationError, match=r"material 'lead': is not described \(known: JSC-1"):
        camera_of(QUIET, material='lead')
    with pytest.raises(SimulationError, match='radii: not all positive'):
        camera_of(QUIET, radius=float('nan'))
    with pytest.raises(SimulationError, match='edge_width_px'):
        TrayCamera(QUIET, TRAY, np.full(1, 0.001), ('glass',), edge_width_px=0.0)
    camera = camera_of(QUIET)
    for bad in (np.zeros((2, 3)), np.full((1, 3), np.nan)):
        with pytest.raises(SimulationError, match='positions'):
            camera.picture(bad, 0)


def test_an_impossible_film_is_refused_at_once():
    with pytest.raises(SimulationError, match='found room for only'):
        film(SimulationSettings(), tray_of(acrylic(100)))
