"""A first start tells what it compiles."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.msg import Log

from nanorocks_ros.nodes.base.compile_progress import COMPILING


def test_a_first_start_is_told_in_log_and_diagnostics_and_a_second_one_compiles_nothing(
    graph, tmp_path, monkeypatch
):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'kernels'))
    statuses, lines = [], []
    graph.node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda message: statuses.extend(message.status), 10
    )
    graph.node.create_subscription(Log, '/rosout', lines.append, 10)
    first = graph.start_program('haff_fitter')
    graph.until(lambda: any(status.message.startswith(COMPILING) for status in statuses), 300.0)
    (level,) = {status.level for status in statuses if status.message.startswith(COMPILING)}
    assert level == DiagnosticStatus.OK
    # The last of them is followed by the state of a node that works.
    graph.until(lambda: not statuses[-1].message.startswith(COMPILING), 300.0)
    assert any(line.msg.startswith(COMPILING) for line in lines)
    assert graph.interrupt(first).code == 0
    second = graph.start_program('haff_fitter')
    statuses.clear()
    graph.until(lambda: len(statuses) >= 2)
    assert graph.interrupt(second).code == 0
    assert COMPILING in graph.output(first)
    assert COMPILING not in graph.output(second)
