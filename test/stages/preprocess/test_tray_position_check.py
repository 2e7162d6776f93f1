"""Regions are checked by edges and beads, with cameras drawn near to one tray."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import IdentityLens, View
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.plate_scene.drawn_camera import drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.stages.preprocess.tray_position_check import position_problem

TRAY = load_trays()[5]
GAS = SimulationSettings(seed=3, first_shake=0.0, mean_speed=0.01)
# Seeds of cameras with a bright rim, sloping walls or shadows that look like a floor.
NESTED = (5, 19, 22)


@lru_cache(maxsize=len(NESTED))
def shot(seed):
    """A frame of a drawn camera, its scale, and the region of the floor."""
    camera = drawn_camera(seed, TRAY, GAS)
    film = SceneFilm(camera.simulation, camera.scene, {TRAY.number: TRAY})
    geometry = film.camera.geometry
    floor = (*geometry.corner(TRAY.number), *geometry.sides(TRAY.number))
    region = Region(*(round(float(side)) for side in floor))
    return film.at(60, 0).frame.image, camera.scene.pixels_per_metre, region


def problem(image, scale, region):
    settings = with_values(
        PipelineSettings(),
        {'preprocess.pixels_per_metre': scale, 'preprocess.regions_px': list(region)},
        'test',
    )
    view = View(camera=IdentityLens(width=image.shape[1], height=image.shape[0]))
    return position_problem(image, view, [region], [TRAY], settings)


@pytest.mark.parametrize('seed', NESTED)
def test_rims_walls_and_shadows_are_not_taken_for_the_floor(seed):
    assert problem(*shot(seed)) == ('', frozenset())


@pytest.mark.parametrize('seed', NESTED)
def test_without_color_the_edges_of_rims_are_believed(seed):
    # The frames are hard: edges alone mislead.
    image, scale, region = shot(seed)
    text, trays = problem(np.ascontiguousarray(image[..., 1:2]), scale, region)
    assert 'the trays look' in text
    assert trays == {TRAY.number}


@pytest.mark.parametrize('seed', NESTED)
@pytest.mark.parametrize('by', [(16, 0), (0, -16)])
def test_a_region_whose_sides_would_cut_beads_is_wrong(seed, by):
    image, scale, region = shot(seed)
    moved = region._replace(x=region.x + by[0], y=region.y + by[1])
    text, trays = problem(image, scale, moved)
    assert text.startswith('preprocess.regions_px looks wrong: ')
    assert trays == {TRAY.number}


def test_a_floor_that_is_told_too_small_cuts_beads_and_that_is_told():
    image, scale, (x, y, width, height) = shot(NESTED[0])
    inner = Region(x + width // 20, y + height // 20, round(0.9 * width), round(0.9 * height))
    text, _ = problem(image, 0.9 * scale, inner)
    assert 'the sides of the floor of tray 5 would cut ' in text
    assert 'set preprocess.check_tray_positions to false' in text
