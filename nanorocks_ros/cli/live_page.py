"""``nanorocks dashboard``: the live page of a running ROS graph.

Tested by ``test/nodes/test_dashboard.py``.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.parsing.tray_options import add_trays_file
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import DashboardGraphSettings, DashboardSettings

if TYPE_CHECKING:
    import argparse


def add_parser(commands: Any) -> None:
    """Add the command."""
    from nanorocks_ros.cli.flags import add_flags

    parser = commands.add_parser('dashboard', help='serve the live page of a running graph')
    parser.add_argument(
        '--namespace', default='', help='namespace of the graph, such as /lab; default /nanorocks'
    )
    add_trays_file(parser, 'those of the flight; give that of the graph')
    add_flags(parser, DashboardSettings(), skip=set())
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Replace this process by the node; does not return."""
    from nanorocks_ros.cli.flags import settings_from
    from nanorocks_ros.dashboard.page_process import full_namespace, node_command, with_token

    settings = settings_from(options, DashboardSettings())
    namespace = full_namespace(options.namespace)
    if find_spec('rclpy') is None:
        raise ConfigurationError(
            'nanorocks dashboard',
            'needs ROS 2, which is not installed',
            'source a ROS 2 Jazzy, or install nanorocks_ros[ros]',
        )
    graph = DashboardGraphSettings(trays_file=options.trays_file)
    command = node_command(settings, graph, namespace)
    os.execve(command[0], command, with_token(os.environ, settings.token))
