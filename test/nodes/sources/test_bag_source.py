"""Parameters that choose a bag are refused when no bag is played."""

from __future__ import annotations

import sys

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.sources.bag_source import refuse_unused_parameters
from nanorocks_ros.settings import BagSettings, PacingSettings


@pytest.fixture
def given(monkeypatch):
    """Give parameters on the command line."""

    def give(*rules):
        flags = [part for rule in rules for part in ('-p', rule)]
        monkeypatch.setattr(sys, 'argv', ['pipeline', '--ros-args', *flags])

    give()
    return give


@pytest.mark.parametrize('source', ['simulator', 'topic'])
@pytest.mark.parametrize('name', ['bag', 'start', 'loop'])
def test_what_belongs_to_a_bag_is_refused_without_one(given, source, name):
    settings = BagSettings(**{name: {'bag': 'x', 'start': 2.0, 'loop': True}[name]})
    given(f'{name}:=something')
    expected = f'parameter {name}: given, but source is {source}; set source:=bag, or leave it out'
    with pytest.raises(ConfigurationError, match=expected):
        refuse_unused_parameters(source, settings, PacingSettings())
    refuse_unused_parameters('bag', settings, PacingSettings())


def test_a_camera_has_no_duration(given):
    given('duration:=2.0')
    settings = PacingSettings(duration=2.0)
    refuse_unused_parameters('simulator', BagSettings(), settings)
    with pytest.raises(ConfigurationError, match='parameter duration: given, but source is topic'):
        refuse_unused_parameters('topic', BagSettings(), settings)


def test_a_file_may_hold_what_a_player_reads_but_no_bag_for_a_simulation(given):
    """The bag of the file may be played to the topic; nobody simulates beside a player."""
    settings = BagSettings(bag='x', start=2.0, loop=True)
    refuse_unused_parameters('topic', settings, PacingSettings(duration=2.0))
    refuse_unused_parameters(
        'simulator', BagSettings(start=2.0, loop=True), PacingSettings(duration=2.0)
    )
    with pytest.raises(ConfigurationError, match='parameter bag: given, but source is simulator'):
        refuse_unused_parameters('simulator', settings, PacingSettings())


def test_what_says_nothing_new_is_no_mistake(given):
    given('bag:=', 'loop:=false')
    refuse_unused_parameters('simulator', BagSettings(), PacingSettings())
