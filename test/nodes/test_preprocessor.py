"""The preprocessor as a node: what it reports of its frames."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from .camera import Camera


def test_time_that_goes_back_is_reported(graph):
    camera = Camera(graph)
    process = graph.start('preprocessor')
    camera.publish_until_seen(1)
    # A single frame at another time would have an impossible stamp.
    for second in (100, 101, 50, 51):
        camera.publish(second=second)
    graph.until(lambda: 'time went back by 51.000 s; starting afresh' in graph.output(process))
    assert graph.interrupt(process).code == 0
