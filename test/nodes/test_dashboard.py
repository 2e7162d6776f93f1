"""The live page beside a real graph: its numbers are those of the topics."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from std_msgs.msg import Float32MultiArray

from nanorocks_ros.nodes.base.communication.ros_messages import qos_of
from nanorocks_ros.records import CorEstimate, CorStatus
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'
TOKEN = 'correct-horse-battery'
CLI = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'


def address(graph, process):
    """Where a page is served, once it is."""
    urls = []

    def is_served():
        urls[:] = re.findall(r'the live page is at (http://\S+)', graph.output(process))
        return bool(urls)

    graph.until(is_served)
    return urls[0]


def page_answers(url):
    try:
        with urllib.request.urlopen(url, timeout=5) as answer:
            return answer.status == 200
    except OSError:
        return False


def text_of(page, selector):
    return page.locator(selector).text_content()


def test_the_page_shows_what_the_topic_says(graph, look):
    cors = []
    graph.node.create_subscription(
        Float32MultiArray,
        topics.COR.of(1),
        lambda message: cors.append(
            from_array(CorEstimate, message.data, tray=1, epoch_ns=0, where='test')
        ),
        qos_of(topics.COR),
    )
    pipeline = graph.start(
        'pipeline', 'source:=bag', f'bag:={SAMPLE}', 'rate:=3.0', 'loop:=true', 'dashboard:=true',
        'dashboard_port:=0',
    )  # fmt: skip
    url = address(graph, pipeline)
    page = look(url)
    graph.until(lambda: text_of(page, '#link') == 'live')
    graph.until(lambda: page.locator('#canvas').is_visible() and len(cors) > 3)

    def agrees():
        cor = cors[-1]
        interval = f'[{cor.restitution.lower:.3f}, {cor.restitution.upper:.3f}]'
        shown = text_of(page, '#cor')
        return (
            f'{cor.restitution.value:.3f} {interval}' in shown and cor.status is CorStatus.COOLING
        )

    graph.until(agrees)
    late = look(url)
    graph.until(lambda: text_of(late, '#cor') == text_of(page, '#cor') != '')
    points = late.locator('.card polyline').get_attribute('points')
    assert len(points.split()) > 10
    nodes = page.locator('.node .name').all_text_contents()
    assert nodes == ['/nanorocks/dashboard', '/nanorocks/pipeline']
    assert 'messages/s' in page.locator('.node', has_text='pipeline').inner_text()
    assert graph.interrupt(pipeline).code == 0
    graph.until(lambda: 'connection lost' in text_of(page, '#link'))
    assert not page_answers(url)


def test_the_page_has_the_token_of_its_pipeline_and_ends_when_that_is_killed(graph):
    pipeline = graph.start(
        'pipeline', 'source:=topic', 'dashboard:=true', 'dashboard_port:=0',
        f'dashboard_token:={TOKEN}', arguments=('-r', '__ns:=/lab'),
    )  # fmt: skip
    url = address(graph, pipeline)
    graph.until(lambda: page_answers(url))
    assert url.endswith(f'?token={TOKEN}')
    with pytest.raises(urllib.error.HTTPError, match='401'):
        urllib.request.urlopen(url.partition('?')[0] + 'app.js', timeout=5)
    pipeline.kill()
    pipeline.wait()
    graph.until(lambda: not page_answers(url))


def command(graph, *arguments):
    return subprocess.run(
        [sys.executable, '-c', CLI, 'dashboard', *arguments],
        env=dict(os.environ, ROS_DOMAIN_ID=str(graph.domain)),
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_command_says_in_one_line_that_an_address_is_not_of_this_machine(graph):
    ended = command(graph, '--host', '192.0.2.1')
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.startswith("dashboard: host '192.0.2.1': is no address of this machine; name one")


def test_the_command_says_in_one_line_that_the_port_is_in_use(graph):
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        ended = command(graph, '--port', str(port))
    assert ended.returncode == 1
    assert ended.stdout == ''
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f'dashboard: port {port} of 127.0.0.1: ')
    assert 'choose another port' in line


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        (('--port', '99999'), 'outside [0, 65535]'),
        (('--token', 'short'), 'has 5 characters; choose 12 or more'),
        (('--namespace', 'no name'), "--namespace: 'no name' is no namespace of ROS"),
    ],
)
def test_a_wrong_call_is_answered_without_a_traceback(graph, arguments, reason):
    ended = command(graph, *arguments)
    assert ended.returncode == 2
    assert ended.stdout == ''
    (line,) = ended.stderr.splitlines()
    assert reason in line
