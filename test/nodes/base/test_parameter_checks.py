"""Unknown parameters and unquoted strings are refused with a remedy."""

from __future__ import annotations

import sys

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.base.parameter_checks import require_string, unknown_parameters

OURS = ('rate', 'bag', 'loop')


def test_a_file_may_hold_what_other_nodes_read_but_no_name_that_none_has(monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['bag_player', '--ros-args', '--params-file', 'all.yaml'])
    of_others = (
        'cooling.probability',
        'tracking.fastest',
        'simulation.tray',
        'scene.noise',
        'dashboard_port',
        'use_sim_time',
    )
    assert unknown_parameters(of_others, OURS) == []
    assert unknown_parameters(('qos_overrides./x.publisher.depth',), OURS) == []
    assert unknown_parameters(('cooling.probabilty', 'rat'), OURS) == [
        "no parameter 'cooling.probabilty'",
        "no parameter 'rat' (did you mean rate?)",
    ]


@pytest.mark.parametrize('rule', ['trays:=1', 'bag_player:trays:=1'])
def test_on_the_command_line_only_parameters_of_the_node_itself_are_known(monkeypatch, rule):
    monkeypatch.setattr(sys, 'argv', ['bag_player', '--ros-args', '-p', 'rate:=1.0', '-p', rule])
    assert unknown_parameters(('trays',), OURS) == ["no parameter 'trays'"]


def test_a_string_that_looks_like_a_number_is_quoted_as_it_was_typed(monkeypatch):
    typed = ['bag_player', '--ros-args', '-p', 'pipeline:bag:=007', '--params-file', 'all.yaml']
    monkeypatch.setattr(sys, 'argv', typed)
    require_string('bag', '2015')
    with pytest.raises(ConfigurationError) as error:
        require_string('bag', 7)
    expected = """parameter bag: 7 is not a string; quote it twice: -p "bag:='007'\""""
    assert str(error.value) == expected
    with pytest.raises(ConfigurationError, match="2015 is not a string; quote it: record: '2015'"):
        require_string('record', 2015)
