"""A trays file from the little that is known of a film."""

from __future__ import annotations

import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray

SIZE = 360, 240
CORNERS = (30.0, 20.0), (330.0, 220.0)


def described(filmed):
    return described_tray(filmed, SIZE)


def test_a_diameter_in_pixels_is_enough():
    tray = described(FilmedTray(beads=(FilmedBeads(diameter_px=20.0),)))
    (species,) = load_trays(tray.text)[1].species
    section = film_section(tray.text)
    assert not species.counted
    assert species.appearance.sign == 0
    assert section.region_px == (0, 0, *SIZE)
    assert not section.scale_known
    assert not section.container_known
    assert species.diameter * section.pixels_per_metre == pytest.approx(20.0)
    words = ' '.join(tray.notices)
    for part in ('single layer', '--height-mm with --diameter-mm'):
        assert part in words


def test_look_and_colour_of_each_species_are_told():
    beads = (
        FilmedBeads(diameter_px=20.0, look='bright', count=3),
        FilmedBeads(diameter_px=30.0, colour='#c03020'),
    )
    tray = described(FilmedTray(beads=beads))
    first, second = load_trays(tray.text)[1].species
    assert (first.appearance.sign, first.expected) == (1, 3)
    assert second.appearance.colour == (32.0, 48.0, 192.0)
    assert 'densities' in ' '.join(tray.notices)


def test_a_known_container_gives_the_scale_and_nothing_is_guessed():
    filmed = FilmedTray(
        beads=(FilmedBeads(diameter_px=20.0, diameter=4e-3, count=8),),
        corners_px=CORNERS,
        sides=(0.06, 0.04),
        height=0.005,
    )
    tray = described(filmed)
    section = film_section(tray.text)
    loaded = load_trays(tray.text)[1]
    assert tray.notices == ()
    assert section.pixels_per_metre == pytest.approx(5000.0)
    assert section.region_px == (30, 20, 300, 200)
    assert section.scale_known
    assert section.container_known
    assert loaded.dimensions == pytest.approx((0.06, 0.04, 0.005))
    assert loaded.species[0].diameter == pytest.approx(4e-3)


def test_a_diameter_in_millimetres_gives_the_scale():
    tray = described(FilmedTray(beads=(FilmedBeads(diameter_px=20.0, diameter=4e-3, count=8),)))
    section = film_section(tray.text)
    assert section.scale_known
    assert section.pixels_per_metre == pytest.approx(5000.0)


@pytest.mark.parametrize(
    ('changes', 'problem'),
    [
        ({'corners_px': ((0.0, 0.0), (400.0, 200.0))}, 'outside the picture'),
        ({'corners_px': ((0.0, 0.0), (5.0, 200.0))}, 'px apart'),
        ({'corners_px': CORNERS, 'sides': (0.04, 0.06)}, 'along columns first'),
        ({'beads': ()}, 'is needed'),
        (
            {'corners_px': ((60.0, 20.0), (300.0, 20.0), (330.0, 220.0), (30.0, 220.0))},
            'no upright rectangle: one is 30 px off, .*; add --sides-mm',
        ),
        (
            {
                'corners_px': ((120.0, 20.0), (240.0, 20.0), (330.0, 220.0), (30.0, 220.0)),
                'sides': (0.06, 0.04),
            },
            'scales differ by .* more than 40%',
        ),
        (
            {'corners_px': ((60.0, 20.0), (300.0, 20.0), (200.0, 40.0), (30.0, 220.0))},
            'do not form a container',
        ),
    ],
)
def test_numbers_that_do_not_fit_are_refused(changes, problem):
    values = {'beads': (FilmedBeads(diameter_px=20.0, count=8),), **changes}
    with pytest.raises(ConfigurationError, match=problem):
        described(FilmedTray(**values))


def test_corners_in_perspective_are_rectified_to_the_sides():
    corners = ((330.0, 220.0), (312.0, 25.0), (52.0, 20.0), (34.0, 215.0))
    beads = (FilmedBeads(diameter_px=20.0, diameter=4e-3),)
    tray = described(FilmedTray(beads=beads, corners_px=corners, sides=(0.06, 0.04), height=5e-3))
    section = film_section(tray.text)
    assert section.corners_px == tuple(corners[k] for k in (2, 1, 0, 3))
    assert section.picture_px == SIZE
    column, row, width, height = section.region_px
    assert (column, row) == (0, 0)
    assert width / height == pytest.approx(1.5, rel=0.01)
    assert width / 0.06 == pytest.approx(section.pixels_per_metre, rel=0.01)
    # As large in pixels as in the film.
    assert width * height == pytest.approx(54_000, rel=0.03)
    assert any('seen at an angle, scales differ by' in notice for notice in tray.notices)


def test_a_rectangle_that_is_turned_in_the_picture_needs_no_sides():
    corners = ((100.0, 20.0), (292.0, 76.0), (264.0, 172.0), (72.0, 116.0))
    tray = described(FilmedTray(beads=(FilmedBeads(diameter_px=20.0),), corners_px=corners))
    section = film_section(tray.text)
    assert section.region_px == (0, 0, 200, 100)
    assert section.perspective.stretch == pytest.approx(1.0, abs=0.01)


def test_corners_that_are_clicked_a_little_off_are_taken():
    corners = ((31.0, 19.0), (330.0, 21.0), (329.0, 222.0), (30.0, 220.0))
    tray = described(FilmedTray(beads=(FilmedBeads(diameter_px=20.0),), corners_px=corners))
    assert film_section(tray.text).region_px == (30, 19, 300, 203)


@pytest.mark.parametrize(
    ('beads', 'told'),
    [
        (FilmedBeads(diameter_px=20.0, look='shiny'), "--look: unknown look 'shiny'; use auto"),
        (FilmedBeads(diameter_px=20.0, colour='reddish'), "--colour: unknown colour 'reddish'"),
        (
            FilmedBeads(diameter_px=250.0),
            '--diameter-px: 250 px do not fit into the container of 360x240',
        ),
    ],
)
def test_what_cannot_be_is_told_by_the_name_of_its_option(beads, told):
    with pytest.raises(ConfigurationError, match=told):
        described(FilmedTray(beads=(beads,)))
