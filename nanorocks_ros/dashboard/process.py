"""The process in which the page is served: the node that hears the graph."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

from nanorocks_ros.experiment.settings import rows

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nanorocks_ros.experiment.settings import DashboardGraphSettings, DashboardSettings

TOKEN_VARIABLE = 'NANOROCKS_DASHBOARD_TOKEN'
"""Environment variable that holds the token, where it is not to be seen in a command line."""


def node_command(
    settings: DashboardSettings, graph: DashboardGraphSettings, namespace: str
) -> list[str]:
    """What starts the node with these settings, all but the token.

    Parameters
    ----------
    settings : DashboardSettings
    graph : DashboardGraphSettings
    namespace : str
        Of the graph; empty: the usual one.
    """
    command = [sys.executable, '-m', 'nanorocks_ros.nodes', 'dashboard', '--ros-args']
    if namespace:
        command += ['-r', f'__ns:={namespace}']
    for row in (*rows(settings), *rows(graph)):
        if row.name != 'token' and row.default != '':
            # JSON is YAML, quotes included.
            command += ['-p', f'{row.name}:={json.dumps(row.default)}']
    return command


def with_token(environment: Mapping[str, str], token: str) -> dict[str, str]:
    """The environment of that process; other users of a machine see command lines, not this."""
    return {**environment, TOKEN_VARIABLE: token} if token else dict(environment)
