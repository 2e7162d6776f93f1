"""The generated page of the nodes is up to date and complete."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.nodes.reference import PAGE
from nanorocks_ros.nodes.run import NODES


def test_the_reference_is_not_stale(root, tmp_path):
    for name in ('bags', 'docs'):
        (tmp_path / name).mkdir()
    (tmp_path / 'bags/tray_1_sample').symlink_to(root / 'bags/tray_1_sample')
    command = [sys.executable, '-m', 'nanorocks_ros.nodes.reference', str(tmp_path)]
    finished = subprocess.run(
        command,
        env={**os.environ, 'PYTHONPATH': str(root)},
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert finished.returncode == 0, finished.stderr
    written = (tmp_path / PAGE).read_text(encoding='utf-8')
    assert (root / PAGE).read_text(encoding='utf-8') == written, 'run `make docs`'


def test_every_node_is_in_the_reference(root):
    page = (root / PAGE).read_text(encoding='utf-8')
    described = {line.removeprefix('## ') for line in page.splitlines() if line.startswith('## ')}
    assert described == set(NODES) - {'demo'}
