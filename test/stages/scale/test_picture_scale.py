"""The beads of a single picture tell the scale, whatever was told."""

from __future__ import annotations

import numpy as np
import pytest
from shared_films import first_picture
from tracking_films import SCALE, tray_film

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.scale.picture_scale import around, scale_near, scale_of_picture

TRACKING = PipelineSettings().tracking


@pytest.fixture(scope='module')
def picture():
    """Tray 1 with a black rim around it, as it looks in a frame."""
    image, _ = next(iter(tray_film(1, 1)))
    return np.pad(image.color, ((60, 60), (60, 60), (0, 0)), constant_values=40)


@pytest.mark.parametrize('told', [0.92, 1.0, 1.08])
def test_the_scale_near_one_that_is_wrong_is_that_of_the_beads(picture, told):
    scale = scale_near(picture, load_trays()[1], TRACKING, told * SCALE)
    assert scale.pixels_per_metre == pytest.approx(SCALE, rel=0.01)
    assert scale.agrees(SCALE)
    assert not scale.agrees(1.06 * SCALE)


def test_the_scale_of_a_picture_is_found_with_nothing_told(picture):
    scale = scale_of_picture(picture, load_trays()[1], TRACKING)
    assert scale.pixels_per_metre == pytest.approx(SCALE, rel=0.01)


@pytest.mark.parametrize('number', [2, 8])
def test_chalk_and_grains_tell_no_scale(picture, number):
    assert scale_of_picture(picture, load_trays()[number], TRACKING) is None


def test_an_empty_picture_tells_no_scale(picture):
    assert scale_of_picture(np.full_like(picture, 130), load_trays()[1], TRACKING) is None


def test_the_part_around_a_region_has_it_in_the_middle():
    image = np.zeros((100, 200), dtype=np.uint8)
    image[20:40, 30:60] = 1
    part = around(image, Region(30, 20, 30, 20))
    rows, columns = np.nonzero(part)
    assert rows.mean() == pytest.approx(0.5 * (part.shape[0] - 1), abs=0.51)
    assert columns.mean() == pytest.approx(0.5 * (part.shape[1] - 1), abs=0.51)


@pytest.mark.parametrize(('name', 'number', 'true'), [('b3_720', 3, 9000.0), ('p3a', 3, 13500.0)])
def test_the_scale_of_a_film_by_other_code_is_found(name, number, true):
    scale = scale_of_picture(first_picture(name), load_trays()[number], TRACKING)
    assert scale.agrees(true)
    assert scale.pixels_per_metre == pytest.approx(true, rel=0.015)
