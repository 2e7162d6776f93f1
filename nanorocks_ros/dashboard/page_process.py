"""The command and environment of the process that serves the page, the node `dashboard`."""

from __future__ import annotations

import json
import re
import sys
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import rows

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nanorocks_ros.settings import DashboardGraphSettings, DashboardSettings

TOKEN_VARIABLE = 'NANOROCKS_DASHBOARD_TOKEN'
"""Environment variable that holds the token, where it is not to be seen in a command line."""


# rcl refuses two underscores in a row in names on the command line.
_NAMESPACE = re.compile(r'(?!.*__)(/[A-Za-z_][A-Za-z0-9_]*)+')
# What ROS allows (RMW_NAMESPACE_MAX_NAME_LENGTH).
_LONGEST_NAMESPACE = 245


def full_namespace(text: str) -> str:
    """A full ROS namespace: it begins with a slash and does not end with one.

    Parameters
    ----------
    text : str
        As somebody wrote it; empty: the usual one.

    Raises
    ------
    ConfigurationError
        When no namespace can be called that.
    """
    if not text or text == '/':
        return text
    full = '/' + text.strip('/')
    if not _NAMESPACE.fullmatch(full) or len(full) > _LONGEST_NAMESPACE:
        raise ConfigurationError(
            '--namespace',
            f'{text!r} is no namespace of ROS',
            'give names of letters, digits and single _, with slashes between them, such as /lab',
        )
    return full


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
    """The environment of that process, with the token: command lines are visible to all users."""
    return {**environment, TOKEN_VARIABLE: token} if token else dict(environment)
