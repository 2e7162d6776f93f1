"""Where the trays are in the picture of the plate."""

from dataclasses import replace
from itertools import combinations

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.plate import PLATE, regions_on_plate
from nanorocks_ros.experiment.trays import load_trays

TRAYS = load_trays()
SHAPE = 1080, 1920


def test_every_tray_that_was_flown_has_a_place_of_its_own():
    regions = regions_on_plate(TRAYS.values(), SHAPE, 12500.0)
    assert set(regions) == set(TRAYS)
    # Walls of at least 2 mm between any two, and around.
    wall = 0.002 * 12500.0
    for first, second in combinations(regions.values(), 2):
        across = max(first.x - second.x - second.width, second.x - first.x - first.width)
        down = max(first.y - second.y - second.height, second.y - first.y - first.height)
        assert max(across, down) >= wall
    left, top = (0.5 * (1920 - PLATE[0] * 12500.0), 0.5 * (1080 - PLATE[1] * 12500.0))
    for region in regions.values():
        assert region.x >= left + wall
        assert region.y >= top + wall
        assert region.x + region.width <= 1920 - left - wall
        assert region.y + region.height <= 1080 - top - wall


def test_sizes_are_those_of_the_floors():
    region = regions_on_plate([TRAYS[7]], SHAPE, 10_000.0)[7]
    assert (region.width, region.height) == (320, 150)


def test_a_tray_without_a_place_or_outside_the_picture_is_named():
    with pytest.raises(ConfigurationError, match=r'^tray 3: has no place on the plate'):
        regions_on_plate([replace(TRAYS[3], place=None)], SHAPE, 12500.0)
    with pytest.raises(ConfigurationError, match=r'^tray 1: lies outside a picture'):
        regions_on_plate(TRAYS.values(), SHAPE, 20_000.0)
