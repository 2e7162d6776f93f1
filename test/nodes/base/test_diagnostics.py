"""Counts, processing times and the most serious problem of a node reach ``/diagnostics``."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.time import Time

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.base.problems import DISK_LOW, Level, Problem
from nanorocks_ros.settings import PriorSettings

FULL = Problem(Level.WARN, 'the disk is full', DISK_LOW)


@pytest.fixture
def report(own_node):
    """A node, and a function that publishes its status now and gives it and the values in it."""
    node, spin_until = own_node
    messages = []
    node.create_subscription(DiagnosticArray, '/diagnostics', messages.append, 10)
    spin_until(lambda: messages)

    def next_status():
        asked_at = node.get_clock().now()
        # A refusal is an error for 2 s only, which a busy machine may spend on waiting for the
        # node's own report.
        node.diagnostics.publish(node.topic_monitor.problems())

        def answers():
            return [
                message for message in messages if Time.from_msg(message.header.stamp) >= asked_at
            ]

        spin_until(answers)
        (status,) = answers()[0].status
        return status, {pair.key: pair.value for pair in status.values}

    return node, next_status


def refuse(_):
    raise FrameError('camera', 'too dark', 'switch on the light')


def test_messages_are_counted_and_timed(report):
    node, next_status = report
    for number in range(3):
        node.diagnostics.process(lambda _: None, number)
    status, values = next_status()
    assert status.name == '/nanorocks/own'
    assert status.level == DiagnosticStatus.OK
    assert values['received'] == '3'
    assert values['refused'] == '0'


def test_an_unusable_message_is_counted_and_shown(report):
    node, next_status = report
    node.diagnostics.process(refuse, None)
    node.diagnostics.process(lambda _: None, None)
    status, values = next_status()
    assert status.level == DiagnosticStatus.ERROR
    assert status.message == values['last refusal'] == 'camera: too dark; switch on the light'
    assert (values['received'], values['refused']) == ('2', '1')


def test_alike_refusals_of_every_frame_are_logged_once(own_node, capfd):
    node, _ = own_node
    for number in range(20):
        node.diagnostics.refuse(FrameError('camera', f'frame {number} is dark', 'light'))
    assert capfd.readouterr().err.count('is dark') == 1


def test_further_problems_stand_among_the_values(report):
    node, next_status = report
    node.topic_monitor.require_publisher('/nowhere')
    node.diagnostics.watched.append(lambda: FULL)
    node.diagnostics.process(refuse, None)
    status, values = next_status()
    assert status.level == DiagnosticStatus.ERROR
    assert values['problem 2'] == 'the disk is full'
    assert values['problem 3'] == 'no publisher on /nowhere'
    assert values['alarm: disk low'] == 'the disk is full'
    assert values['alarm: no publisher'] == 'no publisher on /nowhere'


def test_a_warning_and_a_missing_publisher_are_shown_in_this_order(report):
    node, next_status = report
    node.topic_monitor.require_publisher('/nowhere')
    status, _ = next_status()
    assert (status.level, status.message) == (DiagnosticStatus.WARN, 'no publisher on /nowhere')
    node.diagnostics.watched.append(lambda: FULL)
    status, _ = next_status()
    assert (status.level, status.message) == (DiagnosticStatus.WARN, 'the disk is full')


def test_the_priors_are_told_as_they_are_set_last(report):
    node, next_status = report
    node.diagnostics.note_priors(PriorSettings())
    assert 'walls 0.5 to 1;' in next_status()[1]['priors']
    node.diagnostics.note_priors(PriorSettings(min_wall_restitution=0.8))
    assert 'walls 0.8 to 1;' in next_status()[1]['priors']
