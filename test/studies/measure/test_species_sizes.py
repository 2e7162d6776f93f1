"""Sizes of several species: found by size or look, refused where nothing tells them apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drawn_scenes import DrawnScene, draw
from nanorocks_ros.studies.measure.species_sizes import SpeciesLook, species_sizes

RADII = 7.0, 10.5
SCENE = DrawnScene(sizes=RADII, count=20, frames=24)
RED, BLUE = (40.0, 40.0, 200.0), (200.0, 90.0, 40.0)


@pytest.fixture(scope='module')
def film():
    return draw(SCENE)[0]


def diameters(sizes):
    assert not isinstance(sizes, str), sizes
    return [size.diameter for size in sizes]


def test_species_that_look_alike_are_found_by_size_the_smallest_first(film):
    sizes = species_sizes(film, [SpeciesLook(), SpeciesLook()])
    assert diameters(sizes) == pytest.approx([14.0, 21.0], abs=0.3)
    for size in sizes:
        assert 0.8 * 10 * size.frames < size.discs < 1.1 * 10 * size.frames
        assert size.error < 0.6
    assert str(sizes[0]).startswith('14.0 +- 0.4 px, by ')


def test_what_is_told_of_the_order_counts(film):
    looks = [SpeciesLook(order=3.0), SpeciesLook(order=2.0)]
    assert diameters(species_sizes(film, looks)) == pytest.approx([21.0, 14.0], abs=0.3)


def test_a_size_that_is_told_is_that_of_its_species(film):
    looks = [SpeciesLook(diameter=20.0), SpeciesLook()]
    assert diameters(species_sizes(film, looks)) == pytest.approx([21.0, 14.0], abs=0.3)
    looks = [SpeciesLook(diameter=40.0), SpeciesLook()]
    assert species_sizes(film, looks) == 'none of the discs has the 40.0 px that are given'


def test_three_sizes_are_found():
    scene = replace(SCENE, sizes=(6.0, 9.0, 13.0), count=18)
    sizes = species_sizes(draw(scene)[0], [SpeciesLook()] * 3)
    assert diameters(sizes) == pytest.approx([12.0, 18.0, 26.0], abs=0.4)


def test_colours_tell_species_apart_whatever_their_sizes():
    scene = replace(SCENE, sizes=(10.5, 7.0), colours=(RED, BLUE))
    sizes = species_sizes(draw(scene)[0], [SpeciesLook(colour=RED), SpeciesLook(colour=BLUE)])
    assert diameters(sizes) == pytest.approx([21.0, 14.0], abs=1.0)


def test_dark_and_bright_beads_are_told_apart():
    scene = replace(SCENE, sizes=(10.5, 7.0), floor=(110,) * 3, colours=((25,) * 3, (240,) * 3))
    sizes = species_sizes(draw(scene)[0], [SpeciesLook(sign=-1), SpeciesLook(sign=1)])
    assert diameters(sizes) == pytest.approx([21.0, 14.0], abs=1.0)


def test_one_size_for_two_species_is_refused():
    frames = draw(replace(SCENE, sizes=(9.0,)))[0]
    problem = species_sizes(frames, [SpeciesLook(), SpeciesLook()])
    assert problem == '2 of one look are given, and discs show with diameters of 18.0 px'


def test_any_size_between_two_is_refused():
    frames = draw(replace(SCENE, sizes=tuple(np.linspace(7.0, 13.0, 20))))[0]
    assert isinstance(species_sizes(frames, [SpeciesLook(), SpeciesLook()]), str)


def test_more_sizes_than_species_are_refused(film):
    frames = draw(replace(SCENE, sizes=(6.0, 9.0, 13.0), count=18))[0]
    problem = species_sizes(frames, [SpeciesLook(), SpeciesLook()])
    assert problem.startswith('2 of one look are given, and discs show with diameters of 12.0 and')


def test_looks_that_are_told_of_some_alone_are_refused(film):
    assert 'colour of some' in species_sizes(film, [SpeciesLook(), SpeciesLook(colour=RED)])
    assert 'look of some' in species_sizes(film, [SpeciesLook(), SpeciesLook(sign=1)])


def test_places_that_are_not_allowed_show_no_beads(film):
    looks = [SpeciesLook(), SpeciesLook()]
    whole = species_sizes(film, looks)
    left = species_sizes(film, looks, lambda places: places[:, 0] < 250.0)
    assert sum(size.discs / size.frames for size in left) < 0.9 * sum(
        size.discs / size.frames for size in whole
    )
    nowhere = species_sizes(film, looks, lambda places: places[:, 0] < 0.0)
    assert nowhere == '0 discs in 24 frames'
