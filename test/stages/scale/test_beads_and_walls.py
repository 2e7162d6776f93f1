"""Walls cut no beads."""

from __future__ import annotations

import numpy as np
import pytest
from tracking_films import SCALE, tray_film

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.scale.beads_and_walls import SeenBeads, beads_around

TRACKING = PipelineSettings().tracking
FLOOR = (100.0, 50.0, 200.0, 150.0)


@pytest.mark.parametrize('centre', [(104.0, 120.0), (296.0, 120.0), (200.0, 54.0), (200.0, 196.0)])
def test_a_bead_across_any_side_is_cut(centre):
    beads = SeenBeads(np.array([centre, (200.0, 120.0)]), np.array([12.0, 12.0]))
    assert beads.cut_by(FLOOR) == 1


def test_beads_at_a_wall_and_beads_of_the_next_tray_are_not_cut():
    beads = SeenBeads(np.array([(112.0, 120.0), (110.5, 80.0), (85.0, 120.0)]), np.full(3, 12.0))
    assert beads.cut_by(FLOOR) == 0


def test_one_bead_that_is_cut_may_be_a_stain():
    beads = SeenBeads(np.array([(104.0, 120.0), (104.0, 160.0)]), np.full(2, 12.0))
    assert beads.contradict(FLOOR)
    assert not SeenBeads(beads.centres[:1], beads.radii[:1]).contradict(FLOOR)


@pytest.mark.parametrize(('number', 'share'), [(1, 1.0), (7, 0.09)])
def test_beads_are_found_around_a_region_and_grains_are_left_out(number, share):
    tray = load_trays()[number]
    image, _ = next(iter(tray_film(number, 1)))
    height, width = image.color.shape[:2]
    picture = np.pad(image.color, ((60, 60), (50, 50), (0, 0)), constant_values=40)
    floor = Region(50, 60, width, height)
    seen = beads_around(picture, floor, tray, TRACKING, SCALE)
    assert len(seen.radii) == pytest.approx(share * tray.count, rel=0.15)
    assert not seen.contradict(floor)
    assert seen.contradict(floor._replace(y=60 + round(0.001 * SCALE)))
