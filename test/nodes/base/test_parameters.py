"""Parameters: invalid ones end a node with one line, invalid changes are rejected."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter

from nanorocks_ros.nodes.base.compile_progress import COMPILING

SPEED = 'qos_overrides./nanorocks/tray_1/speed.subscription'


@pytest.mark.parametrize(
    ('name', 'parameter', 'message'),
    [
        ('haff_fitter', 'cooling.duration:=.nan', 'parameter cooling.duration'),
        ('haff_fitter', 'cooling.duration:=-3.0', 'parameter cooling.duration'),
        ('speed_estimator', 'trays:=[9]', 'trays: 9 is outside [1, 8]'),
        ('pipeline', 'speed.method:=guess', "'guess' is none of auto"),
        ('pipeline', 'simulation.tray:=3', 'parameter simulation.tray: 3 is not among trays'),
        ('pipeline', 'bag:=x', 'parameter bag: given, but source is simulator; set source:=bag'),
        ('preprocessor', 'trays_file:=/nowhere.yaml', '/nowhere.yaml: No such file'),
        ('simulator', 'noise:=-1.0', 'parameter noise'),
        ('bag_player', 'rate:=1.0', 'parameter bag: is empty; give the path of a bag'),
        ('bag_player', 'bag:=2015', """2015 is not a string; quote it twice: -p "bag:='2015'\""""),
        ('haff_fitter', f'{SPEED}.reliability:=best_efort', "'best_efort' is not one of system"),
        ('simulator', 'nois:=1.0', "no parameter 'nois' (did you mean noise"),
    ],
)
def test_a_bad_parameter_ends_the_node_with_one_line(graph, name, parameter, message):
    finished = graph.wait(graph.start(name, parameter))
    assert finished.code == 2
    assert message in finished.output
    # Not even on a machine that has compiled nothing yet anything is compiled before.
    assert len(finished.output.splitlines()) == 1, finished.output


def test_an_override_of_an_unknown_topic_ends_the_node_with_one_line(graph):
    parameter = f'{SPEED.replace("speed", "sped")}.depth:=3'
    finished = graph.wait(graph.start('haff_fitter', parameter))
    assert finished.code == 2
    # A node subscribes once it has compiled, and knows its topics then.
    lines = [line for line in finished.output.splitlines() if COMPILING not in line]
    assert len(lines) == 1, finished.output
    assert '(did you mean /nanorocks/tray_1/speed' in lines[0]


def set_parameter(graph, node, name, value):
    client = graph.node.create_client(SetParameters, f'/nanorocks/{node}/set_parameters')
    graph.until(client.service_is_ready)
    parameter = Parameter(name, value=value).to_parameter_msg()
    future = client.call_async(SetParameters.Request(parameters=[parameter]))
    graph.until(future.done)
    return future.result().results[0]


def test_a_bad_change_of_a_parameter_is_rejected_with_the_reason(graph):
    process = graph.start('haff_fitter')
    bad = set_parameter(graph, 'haff_fitter', 'cooling.probability', float('nan'))
    assert not bad.successful
    assert 'cooling.probability' in bad.reason
    good = set_parameter(graph, 'haff_fitter', 'cooling.probability', 0.68)
    assert good.successful, good.reason
    whole = set_parameter(graph, 'haff_fitter', 'cooling.duration', 15)
    assert whole.successful, whole.reason
    assert graph.interrupt(process).code == 0


def test_a_change_that_does_not_fit_the_other_parameters_is_rejected_and_the_node_lives(graph):
    process = graph.start('preprocessor')
    mix = set_parameter(graph, 'preprocessor', 'preprocess.gray_mix', [1.0, 1.0, 1.0])
    assert not mix.successful
    assert 'whose sum is above 0 and at most 1' in mix.reason
    trays = set_parameter(graph, 'preprocessor', 'trays', [1, 2])
    assert not trays.successful
    assert process.poll() is None
    assert graph.interrupt(process).code == 0


def call(graph, node, service_type, service, **request):
    client = graph.node.create_client(service_type, f'/nanorocks/{node}/{service}')
    graph.until(client.service_is_ready)
    future = client.call_async(service_type.Request(**request))
    graph.until(future.done)
    return future.result()


def described(graph, node, names):
    return call(graph, node, DescribeParameters, 'describe_parameters', names=names).descriptors


def test_a_refused_change_leaves_value_and_type(graph):
    process = graph.start('haff_fitter')
    names = ['cooling.duration', 'cooling.relation', 'preprocess.regions_px']
    before = described(graph, 'haff_fitter', names)
    for name, value in zip(names, ('long', 3.0, ['left']), strict=True):
        refused = set_parameter(graph, 'haff_fitter', name, value)
        assert not refused.successful
        assert name in refused.reason or 'Wrong parameter type' in refused.reason
    assert described(graph, 'haff_fitter', names) == before
    regions = set_parameter(graph, 'haff_fitter', 'preprocess.regions_px', [0, 0, 100, 100])
    assert regions.successful, regions.reason
    assert graph.interrupt(process).code == 0


def test_loading_a_dump_of_all_parameters_changes_nothing(graph):
    process = graph.start('haff_fitter')
    listed = call(graph, 'haff_fitter', ListParameters, 'list_parameters').result.names
    # As `ros2 param dump` asks.
    dumped = call(graph, 'haff_fitter', GetParameters, 'get_parameters', names=listed).values
    assert len(dumped) == len(listed)
    changeable = ('cooling.', 'prior.', 'clusters.', 'preprocess.')
    names = [name for name in listed if name.startswith(changeable)]
    values = call(graph, 'haff_fitter', GetParameters, 'get_parameters', names=names).values
    assert len(names) > 20
    for name, value in zip(names, values, strict=True):
        same = [ParameterMessage(name=name, value=value)]
        (result,) = call(
            graph, 'haff_fitter', SetParameters, 'set_parameters', parameters=same
        ).results
        assert result.successful, (name, result.reason)
    assert set_parameter(graph, 'haff_fitter', 'cooling.duration', 15).successful
    output = graph.interrupt(process).output
    assert output.count('changed;') == 1, output
    assert 'cooling.duration changed; the running cycle goes on' in output


def test_a_change_that_concerns_other_stages_does_not_reset_these(graph):
    process = graph.start('speed_estimator')
    assert set_parameter(graph, 'speed_estimator', 'prior.scale_error', 0.01).successful
    assert set_parameter(graph, 'speed_estimator', 'speed.interval', 0.2).successful
    output = graph.interrupt(process).output
    assert 'prior.scale_error changed; the running cycle goes on' in output
    assert 'speed.interval changed; all stages were reset' in output
