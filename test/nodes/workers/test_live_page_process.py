"""The process of the live page: the pipeline can do without it."""

from __future__ import annotations

import socket

import pytest

pytest.importorskip('rclpy')


def test_a_pipeline_continues_when_its_page_cannot_be_served(graph):
    with socket.socket() as taken:
        taken.bind(('127.0.0.1', 0))
        taken.listen()
        port = taken.getsockname()[1]
        pipeline = graph.start(
            'pipeline', 'source:=topic', 'dashboard:=true', f'dashboard_port:={port}'
        )
        graph.until(lambda: 'the pipeline continues without it' in graph.output(pipeline))
        assert f'dashboard: port {port} of 127.0.0.1: ' in graph.output(pipeline)
        assert 'Traceback' not in graph.output(pipeline)
        assert graph.interrupt(pipeline).code == 0
