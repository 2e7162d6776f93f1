"""The empty tray from near: edges, rim, walls, pattern of the floor, motion of the tray."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import NEAR, NEAR_SIMULATION, near_camera

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.simulation.plate_scene.close_up_plate import MARGIN, shifted
from nanorocks_ros.simulation.plate_scene.plate_camera import Instant

SCALE = NEAR.pixels_per_metre
AWAY = {1: np.array([[0.0133, 0.0133, 0.001]])}
RIM = replace(NEAR, rim_width=0.0012, rim_shade=0.4)
# Half of 304 pixels less half of 15 mm.
CORNER = 152.0 - 0.0075 * SCALE
WIDTH = 0.0012 * SCALE


def empty(scene, **instant):
    """Green of a picture with the only bead in a corner."""
    moved = Instant(AWAY, instant.get('plate', (0.0, 0.0)))
    return near_camera(scene).exposed([moved], 0).astype(float)[..., 1]


def edge(line, near):
    """Where a line of pixels crosses half way between its levels beside a place."""
    low, high = line[near - 9 : near - 5].mean(), line[near + 5 : near + 9].mean()
    part = (line[near - 5 : near + 5] - low) / (high - low)
    return near + 5.0 - part.sum()


def test_the_floor_has_its_region_to_a_part_of_a_pixel():
    camera = near_camera(RIM)
    assert camera.geometry.corner(1) == pytest.approx((CORNER, CORNER))
    assert camera.geometry.regions[1] == Region(51, 51, 202, 202)
    # Pictures are linear in the shade of the rim: their difference is the rim alone.
    dark, bright = (empty(replace(RIM, rim_shade=shade)) for shade in (0.4, 1.2))
    rim = bright - dark
    for line in (rim[100:200].mean(axis=0), rim[:, 100:200].mean(axis=1)):
        for part, middle in (
            (slice(150), CORNER - 0.5 * WIDTH),
            (slice(150, None), 304.0 - CORNER + 0.5 * WIDTH),
        ):
            place = np.arange(304)[part] + 0.5
            share = line[part] / np.median(line[part][line[part] > 0.8 * line[part].max()])
            assert share.sum() == pytest.approx(WIDTH, abs=0.25)
            assert (share * place).sum() / share.sum() == pytest.approx(middle, abs=0.05)


@pytest.mark.parametrize('width', [0.0008, 0.0016])
def test_a_rim_has_its_width_and_shade(width):
    for shade in (0.4, 0.8):
        picture = empty(replace(NEAR, rim_width=width, rim_shade=shade))
        line = picture[100:200].mean(axis=0)
        outer = round(304.0 - CORNER + width * SCALE)
        around = line[outer + 6 : outer + 20].mean()
        rim = line[254 + 2 : outer - 2].mean()
        # This side faces the lamp: 0.6 of the light that depends on the direction.
        assert rim / around == pytest.approx(shade * (1.0 + 0.4 * 0.6), rel=0.06)


def test_the_pattern_of_the_floor_has_its_strength_and_length():
    spreads, lengths = [], []
    for strength, length in ((0.03, 0.0004), (0.06, 0.0004), (0.06, 0.0012)):
        scene = replace(RIM, floor_texture=strength, floor_texture_length=length)
        ratio = (
            empty(scene)[80:230, 80:230] / empty(replace(scene, floor_texture=0.0))[80:230, 80:230]
        )
        ratio -= ratio.mean()
        spreads.append(ratio.std())
        lengths.append((ratio[:, 6:] * ratio[:, :-6]).mean() / ratio.var())
    assert spreads[1] == pytest.approx(2.0 * spreads[0], rel=0.1)
    assert spreads[0] == pytest.approx(0.03, rel=0.3)
    assert lengths[2] > lengths[1] + 0.2


def test_a_camera_at_a_finite_height_sees_the_walls():
    far, near = empty(RIM), empty(replace(RIM, camera_height=0.06))
    # The floor stays, the rim moves out: between them are the walls.
    magnified = 152.0 + (152.0 - CORNER) / (1.0 - 0.003 / 0.06)
    wall = near[100:200, 256 : int(magnified) - 1]
    assert abs(far[100:200, 100:240].mean() - near[100:200, 100:240].mean()) < 1.0
    line = near[100:200].mean(axis=0)
    rim = line[int(magnified) + 3 : int(magnified) + 10].mean()
    assert wall.mean() > rim + 8.0
    assert wall.mean() < near[100:200, 200:240].mean() - 20.0


def test_the_tray_moves_over_its_surroundings():
    moved = 0.0002
    still, swung = empty(RIM), empty(RIM, plate=(moved, 0.0))
    assert (still[:30] == swung[:30]).all()
    line, shifted_line = still[100:200].mean(axis=0), swung[100:200].mean(axis=0)
    shift = edge(shifted_line, 255) - edge(line, 253)
    assert shift == pytest.approx(moved * SCALE, abs=0.1)


def test_shades_of_floor_and_plate_are_their_own():
    plain = empty(RIM)
    dark = empty(replace(RIM, floor_shade=0.8, plate_shade=0.6))
    assert (dark[100:200, 100:200] / plain[100:200, 100:200]).mean() == pytest.approx(
        0.8, abs=0.01
    )
    assert (dark[:25] / plain[:25]).mean() == pytest.approx(0.6, abs=0.01)


def test_a_picture_is_shifted_by_any_part_of_a_pixel():
    y, x = np.mgrid[-MARGIN : 40 + MARGIN, -MARGIN : 60 + MARGIN]

    def wave(x, y):
        return 20000.0 + 9000.0 * np.sin(0.7 * x + 0.2) * np.cos(0.5 * y)

    source = np.rint(wave(x, y)).astype(np.uint16)[np.newaxis]
    target = np.empty((1, 40, 60), dtype=np.uint16)
    inner = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
    for shift in ((0.0, 0.0), (3.0, -2.0), (0.37, 0.0), (-7.21, 4.66)):
        shifted(target, source, *shift)
        expected = wave(x - shift[0], y - shift[1])[inner]
        # One part in a hundred of the amplitude.
        assert np.abs(target[0] - expected).max() < 90.0


def test_a_picture_near_the_tray_is_drawn_from_the_seed():
    first, second = empty(RIM), empty(RIM)
    assert (first == second).all()
    other = near_camera(RIM, replace(NEAR_SIMULATION, seed=2)).picture(AWAY, 0)
    assert (other[..., 1] != first).mean() > 0.5
