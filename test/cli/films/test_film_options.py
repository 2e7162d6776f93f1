"""Options that describe the film in place of a trays file."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.studies.measure.told_film import filmed_tray


def parsed(*arguments):
    return filmed_tray(build_parser().parse_args(['track', 'a.avi', *arguments]))


def test_options_describe_species_and_container():
    filmed = parsed(
        '--diameter-px', '20', '31', '--diameter-mm', '2', '3.1', '--count', '7', '8',
        '--corners', '1', '2', '30', '40', '--sides-mm', '90', '60', '--height-mm', '4',
    )  # fmt: skip
    assert [beads.count for beads in filmed.beads] == [7, 8]
    assert filmed.beads[1].diameter == pytest.approx(3.1e-3)
    assert filmed.corners_px == ((1.0, 2.0), (30.0, 40.0))
    assert filmed.sides == pytest.approx((0.09, 0.06))
    assert filmed.height == pytest.approx(4e-3)
    assert parsed() is None


def test_a_diameter_may_be_left_to_the_film():
    filmed = parsed('--diameter-px', 'auto', '--count', '7')
    assert math.isnan(filmed.beads[0].diameter_px)
    assert filmed.beads[0].count == 7


@pytest.mark.parametrize(
    ('arguments', 'problem'),
    [
        (('--diameter-px', '-1'), 'above 0'),
        (('--diameter-px', 'nan'), 'above 0'),
        (('--count', '3'), 'needs --diameter-px'),
        (('--height-mm', '3'), 'needs --diameter-px'),
        (('--diameter-px', '20', '--count', '3', '4'), 'one for each species'),
        (('--diameter-px', '20', '--corners', '1', '2', '3'), 'two corners or four'),
    ],
)
def test_options_that_do_not_fit_are_refused(arguments, problem):
    with pytest.raises(ConfigurationError, match=problem):
        parsed(*arguments)
