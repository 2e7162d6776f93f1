"""Colours of species: told, learnt beside them, absent from the film."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.species_colours import SpeciesColours

RED, DARK, BLUE = (40.0, 40.0, 200.0), (60.0, 60.0, 60.0), (200.0, 80.0, 40.0)
WHITE, GRAY = (235.0, 235.0, 235.0), (140.0, 140.0, 140.0)
FLOOR = (40.0, 120.0, 30.0)
SIZE = (7.5, 10.8)


def beads(*colours, number=20, seed=1):
    """Colours of so many beads of each, in uneven light and with noise."""
    random = np.random.default_rng(seed)
    shade = random.uniform(0.85, 1.15, (len(colours), number, 1))
    scatter = random.normal(0.0, 3.0, (len(colours), number, 3))
    return (np.array(colours)[:, None] * shade + scatter).reshape(-1, 3)


def assigned(looks, film, discs):
    """Which discs may be of which species, (species, discs)."""
    colours = SpeciesColours(looks)
    colours.learn(film)
    around = np.tile(FLOOR, (len(discs), 1))
    return np.array([colours.of(k, discs, around) for k in range(len(looks))])


def look(colour=None, radii=SIZE):
    return BeadLook(radii=radii, colour=colour)


def test_the_colour_of_a_species_is_learnt_beside_one_that_is_told():
    discs = beads(RED, DARK)
    told, learnt = assigned([look(RED), look()], discs, discs)
    is_red = np.repeat([True, False], 20)
    assert (told == is_red).all()
    assert (learnt == ~is_red).all()


def test_the_order_of_the_species_tells_nothing():
    discs = beads(RED, DARK)
    first = assigned([look(RED), look()], discs, discs)
    second = assigned([look(), look(RED)], discs, discs)
    assert (first == second[::-1]).all()


def test_a_colour_may_be_told_roughly():
    discs = beads(RED, DARK)
    orange = 30.0, 120.0, 230.0
    assert (
        assigned([look(orange), look()], discs, discs)[0] == np.repeat([True, False], 20)
    ).all()


def test_a_few_beads_are_enough_on_either_side():
    for few, many in ((RED, DARK), (DARK, RED)):
        discs = np.concatenate([beads(few, number=2), beads(many, number=60)])
        told, learnt = assigned([look(RED), look()], discs, discs)
        is_red = np.arange(62) < 2 if few is RED else np.arange(62) >= 2
        assert (told == is_red).all()
        assert (learnt == ~is_red).all()


def test_beads_of_one_colour_alone_belong_to_one_species():
    for colour, owner in ((RED, 0), (BLUE, 1)):
        discs = beads(colour)
        rows = assigned([look(RED), look()], discs, discs)
        assert rows[owner].all()
        assert not rows[1 - owner].any()


def test_sizes_tell_equal_colours_apart():
    discs = beads(DARK)
    looks = [look(DARK, (8.0, 12.0)), look(None, (4.0, 6.0))]
    assert assigned(looks, discs, discs).all()


def test_white_and_gray_are_two_colours():
    discs = beads(WHITE, GRAY)
    white, gray = assigned([look(WHITE), look(GRAY)], discs, discs)
    assert (white == np.repeat([True, False], 20)).all()
    assert (gray == ~white).all()


def test_two_species_with_one_colour_share_its_discs():
    discs = beads(RED, DARK)
    rows = assigned([look(RED), look(RED), look()], discs, discs)
    assert (rows[0] == rows[1]).all()
    assert (rows[2] == ~rows[0]).all()


def test_what_is_farther_from_the_colour_than_its_surroundings_is_no_bead():
    looks = [look(RED), look(BLUE)]
    colours = SpeciesColours(looks)
    colours.learn(beads(RED, BLUE))
    reddish = np.tile([45.0, 60.0, 150.0], (20, 1))
    assert not colours.of(0, beads(FLOOR), reddish).any()
    assert colours.of(0, reddish, beads(FLOOR)).all()


def test_nothing_is_to_be_told_apart_without_colours():
    discs = beads(RED, DARK)
    assert assigned([look(), look()], discs, discs).all()
