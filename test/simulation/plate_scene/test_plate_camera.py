"""Pictures of the scene: positions, sizes, and each effect of the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import PLAIN, SCALE, SIMULATION, TRAYS, camera_with_one, empty_camera

from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.settings import SceneSettings
from nanorocks_ros.simulation.plate_scene.plate_camera import SceneCamera
from nanorocks_ros.simulation.plate_scene.plate_oscillation import PlateMotion

LENS = replace(PLAIN, fisheye=0.6)
# No shading: the share of a pixel that the bead covers can be read from its colour.
FLAT = {'shading': 0.0, 'highlights': 0.0}


def drawn(camera, tray, place, **how):
    return camera.picture({tray: np.array([place])}, 0, **how).astype(float)


def share_of_bead(scene, tray, place, moved=(0.0, 0.0), **bead):
    """What one flat bead covers of every pixel, from pictures of it here and elsewhere."""
    camera = camera_with_one(tray, replace(scene, **FLAT), **bead)
    motion = PlateMotion(moved, (0.0, 0.0))
    sides = TRAYS[tray].dimensions
    elsewhere = [sides[0] - place[0], sides[1] - place[1], 0.0015]
    first_place, second_place = (drawn(camera, tray, p, motion=motion) for p in (place, elsewhere))
    column, row = camera.geometry.camera.distorted(
        camera.geometry.rectified(tray, np.array([place]))
    )[0]
    y, x = np.mgrid[0.5 : first_place.shape[0], 0.5 : first_place.shape[1]]
    # Red is brighter there, or darker: one sign, as the bead is of one even colour.
    change = (first_place - second_place)[:, :, 1]
    near = np.hypot(x - column, y - row) < 25
    weight = np.where(near, np.abs(change), 0.0)
    weight[weight < 2.0] = 0.0
    return camera, (column, row), weight, (x, y)


@pytest.mark.parametrize('scene', [PLAIN, LENS, replace(LENS, defocus_px=1.0)])
@pytest.mark.parametrize(('tray', 'place'), [(1, (0.0031, 0.0044)), (6, (0.0123, 0.0042))])
def test_a_bead_is_drawn_where_the_lens_puts_it(scene, tray, place):
    _, (column, row), weight, (x, y) = share_of_bead(scene, tray, (*place, 0.0015))
    assert np.sum(weight * x) / weight.sum() == pytest.approx(column, abs=0.05)
    assert np.sum(weight * y) / weight.sum() == pytest.approx(row, abs=0.05)


def test_beads_fly_past_the_plate_while_it_swings():
    moved = (0.00013, -0.00021)
    _, (column, row), weight, (x, y) = share_of_bead(
        LENS, 3, (0.0131, 0.0047, 0.0015), moved=moved
    )
    assert np.sum(weight * x) / weight.sum() == pytest.approx(column, abs=0.05)
    assert np.sum(weight * y) / weight.sum() == pytest.approx(row, abs=0.05)


def test_the_lens_makes_a_bead_near_the_edge_smaller_by_its_local_scale():
    place = (0.0123, 0.0042, 0.0015)
    camera, _, weight, _ = share_of_bead(LENS, 6, place)
    points = camera.geometry.rectified(6, np.array([place]))
    local = np.linalg.det(camera.geometry.local_scales(points)[0])
    area = weight.sum() / np.median(weight[weight > 0.8 * weight.max()])
    assert area == pytest.approx(local * np.pi * (0.001 * SCALE) ** 2, rel=0.02)
    assert local < 0.9


def test_the_edges_of_a_tray_are_those_of_its_region():
    camera = empty_camera(replace(PLAIN, defocus_px=0.7))
    picture = camera.picture({}, 0).astype(float)
    region = camera.geometry.regions[3]
    rows = slice(region.y + 30, region.y + region.height - 10)
    line = picture[rows, :, 1].mean(axis=0)
    # The far chamfer is brighter than the floor: where the step is half done.
    edge = region.x + region.width
    window = line[edge - 8 : edge + 5]
    low, high = np.median(window[:4]), window.max()
    at = np.interp(0.5 * (low + high), window[3:9], np.arange(3, 9) + edge - 8 + 0.5)
    assert at == pytest.approx(edge, abs=0.35)


def test_the_plate_moves_by_its_displacement_to_a_twentieth_of_a_pixel():
    scene = replace(PLAIN, defocus_px=0.7)
    camera = empty_camera(scene)
    still = camera.picture({}, 0).astype(np.float32)[:, :, 1]
    displacement = (0.00013, -0.00021)
    swung = camera.picture({}, 0, motion=PlateMotion(displacement, (0.0, 0.0)))
    swung = swung.astype(np.float32)[:, :, 1]
    x, y, width, height = camera.geometry.regions[5]
    part = np.s_[y - 8 : y + height + 8, x - 8 : x + width + 8]
    # Least squares of the first order, about the nearest whole pixel.
    nearest = np.rint(np.array(displacement) * SCALE).astype(int)
    shifted = np.roll(still, (nearest[1], nearest[0]), (0, 1))
    down, across = (first[part].ravel() for first in np.gradient(shifted))
    change = (shifted - swung)[part].ravel()
    shift = np.linalg.lstsq(np.column_stack([across, down]), change, rcond=None)[0] + nearest
    np.testing.assert_allclose(shift, np.array(displacement) * SCALE, atol=0.05)


def test_pictures_do_not_depend_on_earlier_ones():
    scene = replace(SceneSettings(), pixels_per_metre=SCALE, noise=0.0)
    first, second = (camera_with_one.__wrapped__(2, scene) for _ in range(2))
    first_place, second_place = (0.004, 0.005, 0.001), (0.030, 0.0052, 0.002)
    swung = PlateMotion((0.0002, 0.0001), (0.0, 0.0))
    before = drawn(first, 2, first_place)
    np.testing.assert_array_equal(drawn(first, 2, first_place), before)
    drawn(first, 2, second_place, motion=swung)
    np.testing.assert_array_equal(drawn(first, 2, first_place), before)
    moved = drawn(first, 2, first_place, motion=swung)
    drawn(second, 2, second_place)
    np.testing.assert_array_equal(drawn(second, 2, first_place, motion=swung), moved)


@pytest.mark.parametrize('noise', [0.5, 2.0, 6.0])
def test_the_noise_has_the_standard_deviation_asked_for(noise):
    camera = empty_camera(replace(PLAIN, noise=noise))
    pictures = np.stack([camera.picture({}, k)[::4] for k in range(30)]).astype(float)
    variance = pictures.var(axis=0, ddof=1).mean()
    # Rounding to whole gray levels adds 1/12.
    assert np.sqrt(variance) == pytest.approx(np.sqrt(noise**2 + 1.0 / 12.0), rel=0.02)


def test_without_noise_frames_of_the_same_scene_are_the_same():
    camera = empty_camera()
    np.testing.assert_array_equal(camera.picture({}, 0), camera.picture({}, 1))


def test_the_noise_of_a_frame_depends_on_its_number_alone():
    first, second = (empty_camera.__wrapped__(replace(PLAIN, noise=2.0)) for _ in range(2))
    expected = [first.picture({}, k) for k in range(3)]
    for k in (2, 0, 1):
        np.testing.assert_array_equal(second.picture({}, k), expected[k])
    assert not np.array_equal(expected[0], expected[1])


def test_glare_saturates_parts_of_trays_two_and_four_and_of_no_other():
    with_glare, without = empty_camera(replace(PLAIN, glare=1.0)), empty_camera()
    bright, dull = (camera.picture({}, 0).astype(int) for camera in (with_glare, without))
    for number, (x, y, width, height) in with_glare.geometry.regions.items():
        part = np.s_[y : y + height, x : x + width]
        saturated = np.mean(bright[part].min(axis=2) == 255)
        if number in (2, 4):
            assert 0.03 < saturated < 0.3
        else:
            assert saturated == 0.0
        if number in (6, 8):
            np.testing.assert_array_equal(bright[part], dull[part])


def test_the_camera_says_how_much_glare_there_is_in_every_pixel():
    with_glare, without = empty_camera(replace(PLAIN, glare=1.0)), empty_camera()
    bright, dull = (camera.picture({}, 0).astype(float) for camera in (with_glare, without))
    expected = np.minimum(dull[:, :, 1] + with_glare.glare, 255.0)
    np.testing.assert_allclose(bright[:, :, 1], expected, atol=1.5)
    assert without.glare is None


def test_glare_stays_where_it_is_while_the_plate_swings():
    camera = empty_camera(replace(PLAIN, glare=3.0))
    x, y, width, height = camera.geometry.regions[2]
    part = np.s_[y : y + height, x : x + width]

    def core(displacement):
        picture = camera.picture({}, 0, motion=PlateMotion(displacement, (0.0, 0.0)))
        rows, columns = np.nonzero(picture[part].min(axis=2) == 255)
        return rows.mean(), columns.mean()

    np.testing.assert_allclose(core((0.0002, 0.0002)), core((0.0, 0.0)), atol=0.6)


def test_light_falls_towards_the_edge_by_the_vignetting_and_rises_by_the_gradient():
    even = empty_camera().picture({}, 0).astype(float)
    dark = empty_camera(replace(PLAIN, vignetting=0.3)).picture({}, 0).astype(float)
    tilted = empty_camera(replace(PLAIN, gradient=0.4)).picture({}, 0).astype(float)
    middle = SIMULATION.height_px // 2
    rows = slice(middle - 20, middle + 20)
    left, right = slice(0, 30), slice(930, 960)
    assert dark[rows, left].sum() / even[rows, left].sum() == pytest.approx(0.7, abs=0.03)
    assert dark[rows, 470:490].sum() / even[rows, 470:490].sum() == pytest.approx(1.0, abs=0.01)
    falls = [tilted[rows, part].sum() / even[rows, part].sum() for part in (left, right)]
    assert falls[0] - falls[1] == pytest.approx(0.4, abs=0.03)


def test_bands_of_light_are_periodic():
    camera = empty_camera(replace(PLAIN, flicker=0.1, flicker_period=4.0))
    levels = [
        camera.picture({}, 0, time=t).astype(float)[380].mean() for t in np.arange(0, 4, 0.25)
    ]
    mean = np.mean(levels)
    assert np.ptp(levels) / mean == pytest.approx(0.2, rel=0.1)
    again = camera.picture({}, 0, time=4.0)
    np.testing.assert_array_equal(again, camera.picture({}, 0, time=0.0))


def test_chalk_brightens_only_the_trays_that_have_it():
    dusty, clean = (
        empty_camera(replace(PLAIN, chalk=c)).picture({}, 0).astype(float) for c in (1.0, 0.0)
    )
    for number, (x, y, width, height) in empty_camera().geometry.regions.items():
        part = np.s_[y + 10 : y + height - 5, x + 10 : x + width - 5]
        change = dusty[part].mean() - clean[part].mean()
        if TRAYS[number].chalk:
            assert change > 8.0
        else:
            assert change == 0.0


def test_a_bead_with_chalk_is_brighter_and_less_red():
    place = (0.016, 0.005, 0.0015)
    colours = []
    for chalk in (0.0, 1.0):
        camera = camera_with_one(2, replace(PLAIN, chalk=chalk))
        column, row = camera.geometry.rectified(2, np.array([place]))[0].astype(int)
        part = drawn(camera, 2, place)[row - 6 : row + 6, column - 6 : column + 6]
        colours.append(part.mean(axis=(0, 1)))
    assert colours[1].sum() > colours[0].sum() + 40
    assert colours[1][2] / colours[1][0] < 0.7 * colours[0][2] / colours[0][0]


def test_defocus_widens_an_outline_by_its_standard_deviation():
    place = (0.0045, 0.0075, 0.0015)
    widths = []
    for defocus in (0.0, 1.5):
        scene = replace(PLAIN, defocus_px=defocus)
        _, (column, row), weight, (x, y) = share_of_bead(scene, 1, place, diameter=0.003)
        distance, share = np.hypot(x - column, y - row).ravel(), weight.ravel()
        bins = np.arange(4.0, 23.0, 0.5)
        profile = [share[(distance >= b) & (distance < b + 0.5)].mean() for b in bins]
        slope = -np.diff(np.array(profile) / profile[0])
        slope[slope < 0.004] = 0.0
        at = bins[:-1] + 0.5
        mean = np.sum(slope * at) / slope.sum()
        widths.append(np.sqrt(np.sum(slope * (at - mean) ** 2) / slope.sum()))
    assert widths[1] == pytest.approx(np.hypot(widths[0], 1.5), rel=0.15)


def test_shadows_darken_the_floor_away_from_the_lamp_and_nothing_else():
    place = (0.0075, 0.0075, 0.0020)
    lit, shaded = (
        drawn(camera_with_one(1, replace(PLAIN, shadows=s)), 1, place) for s in (0.0, 0.5)
    )
    change = shaded - lit
    assert change.max() <= 1.0
    camera = camera_with_one(1)
    column, row = camera.geometry.rectified(1, np.array([place]))[0]
    rows, columns = np.nonzero(change.min(axis=2) < -4)
    assert columns.mean() > column + 3
    assert rows.mean() > row + 3
    x, y, width, height = camera.geometry.regions[1]
    change[y : y + height, x : x + width] = 0.0
    assert not change.any()


def test_copper_beads_are_ovals_of_the_area_of_their_spheres():
    scene = replace(PLAIN, ovality=0.3, turning=1.0, **FLAT)
    place = np.array([[0.016, 0.005, 0.0015]])
    areas, ratios = [], []
    for seed in range(4):
        simulation = replace(SIMULATION, seed=seed)
        camera = camera_with_one(5, scene, simulation, material='copper')
        empty = empty_camera(scene, simulation).picture({}, 0).astype(float)
        change = camera.picture({5: place}, 0, turned=0.7).astype(float) - empty
        weight = np.abs(change[:, :, 0])
        weight[weight < 3.0] = 0.0
        weight /= np.median(weight[weight > 0.9 * weight.max()])
        rows, columns = np.nonzero(weight > 0.5)
        lengths = np.linalg.eigvalsh(np.cov(np.stack([columns, rows])))
        areas.append(weight.sum())
        ratios.append(np.sqrt(lengths[1] / lengths[0]))
    np.testing.assert_allclose(areas, np.pi * (0.001 * SCALE) ** 2, rtol=0.04)
    assert max(ratios) > 1.15
    assert np.ptp(ratios) > 0.05


def test_grains_are_dark_and_of_irregular_outline():
    place = np.array([[0.0075, 0.0075, 0.0015]])
    outlines = []
    for seed in range(3):
        simulation = replace(SIMULATION, seed=seed)
        scene = replace(PLAIN, irregularity=0.15)
        camera = camera_with_one(8, scene, simulation, material='JSC-1', diameter=0.002)
        empty = empty_camera(scene, simulation).picture({}, 0).astype(float)
        picture = camera.picture({8: place}, 0).astype(float)
        change = (empty - picture)[:, :, 1]
        column, row = camera.geometry.rectified(8, place)[0]
        inside = change > 0.4 * change.max()
        rows, columns = np.nonzero(inside)
        assert columns.mean() + 0.5 == pytest.approx(column, abs=0.35)
        assert rows.mean() + 0.5 == pytest.approx(row, abs=0.35)
        assert inside.sum() == pytest.approx(np.pi * (0.001 * SCALE) ** 2, rel=0.12)
        assert picture[inside].mean() < 90
        y, x = np.mgrid[0.5:760, 0.5:960]
        outlines.append(inside[np.hypot(x - column, y - row) < 9 * 0.86].mean())
    assert min(outlines) < 0.99


def test_beads_do_not_depend_on_what_other_effects_are_on():
    place = (0.016, 0.005, 0.0015)
    scenes = (PLAIN, replace(PLAIN, glare=1.0), replace(PLAIN, turning=2.0))
    first, glaring, turning = (
        drawn(camera_with_one(5, s, material='glass'), 5, place) for s in scenes
    )
    np.testing.assert_array_equal(turning, first)
    x, y, width, height = camera_with_one(5).geometry.regions[5]
    part = np.s_[y : y + height, x + width // 3 : x + width]
    np.testing.assert_array_equal(glaring[part], first[part])


def test_invalid_positions_are_refused():
    camera = camera_with_one(1)
    with pytest.raises(SimulationError, match=r'positions of tray 1: shape \(2, 3\)'):
        camera.picture({1: np.zeros((2, 3))}, 0)
    with pytest.raises(SimulationError, match='finite'):
        camera.picture({1: np.full((1, 3), np.nan)}, 0)
    with pytest.raises(SimulationError, match=r'positions: of trays \[2\]; give those of \[1\]'):
        camera.picture({2: np.zeros((1, 3))}, 0)
    far = PlateMotion((0.01, 0.0), (0.0, 0.0))
    with pytest.raises(SimulationError, match='plate: displaced by 90 px'):
        camera.picture({1: np.full((1, 3), 0.005)}, 0, motion=far)


def test_an_invalid_camera_is_refused():
    with pytest.raises(ConfigurationError, match='lies outside a picture of 960 x 760 px'):
        empty_camera(SceneSettings(pixels_per_metre=14000.0))
    with pytest.raises(ConfigurationError, match='give four numbers and two'):
        empty_camera(replace(PLAIN, lens_distortion=(0.1,)))
    with pytest.raises(SimulationError, match='radii of tray 1'):
        SceneCamera(SIMULATION, PLAIN, TRAYS, {1: np.full(3, 0.001)})
