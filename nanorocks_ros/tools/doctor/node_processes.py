"""Nodes that run on this machine, as its process list tells, and whether this shell hears them.

Tested by ``test/tools/doctor/test_node_processes.py``.
"""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.tools.doctor.findings import Finding, Status

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_PROCESSES = Path('/proc')
_MODULE = 'nanorocks_ros.nodes'
# What keeps nodes of one machine from hearing each other, with what holds where it is not set.
# LOCALHOST and SUBNET hear each other there.
_DOMAIN, _RANGE, _RMW = 'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'RMW_IMPLEMENTATION'
_OFF = 'OFF'
_DEFAULTS = {_DOMAIN: '0', _RANGE: 'SUBNET', _RMW: 'rmw_fastrtps_cpp'}


class NodeProcess(NamedTuple):
    """A process that runs a node of this package.

    Parameters
    ----------
    pid : int
    name : str
        Of the executable.
    variables : mapping of str to str
        Its environment.
    is_renamed : bool
        Whether the node has another name than the executable.
    """

    pid: int
    name: str
    variables: Mapping[str, str]
    is_renamed: bool = False

    @property
    def is_near(self) -> bool:
        """Whether nothing in the environments keeps this shell from hearing it."""
        return not _differing(self)


def running(names: Sequence[str], processes: Path = _PROCESSES) -> list[NodeProcess]:
    """The nodes that this user runs; none on a system without ``/proc``.

    Parameters
    ----------
    names : sequence of str
        Of the executables.
    processes : Path
    """
    listed = []
    for folder in sorted(processes.glob('[0-9]*'), key=lambda each: int(each.name)):
        try:
            words = (folder / 'cmdline').read_text('utf-8', 'replace').split('\0')
            name = _node_of(words, names)
            if not name:
                continue
            pairs = (folder / 'environ').read_text('utf-8', 'replace').split('\0')
        except OSError:
            # It has ended, or is of another user.
            continue
        variables = dict(pair.split('=', 1) for pair in pairs if '=' in pair)
        renamed = any('__node:=' in word or '__name:=' in word for word in words)
        listed.append(NodeProcess(int(folder.name), name, variables, renamed))
    return listed


def _node_of(words: Sequence[str], names: Sequence[str]) -> str:
    """The node that a command line starts, directly or as an installed executable."""
    for before, word in pairwise(words):
        if before == _MODULE and word in names:
            return word
    for word in words[:2]:
        path = Path(word)
        if path.name in names and path.parent.name == 'nanorocks_ros':
            return path.name
    return ''


def unheard(nodes: Sequence[NodeProcess]) -> list[Finding]:
    """The nodes that this shell does not hear, by its variables and theirs."""
    return [
        Finding(
            name=f'{node.name} (process {node.pid})',
            status=Status.WARNING,
            found='not heard: '
            + ', '.join(
                f'{name} is {there} there, {here} here' for name, there, here in differing
            ),
            remedy=_remedy(node, differing),
        )
        for node in nodes
        if (differing := _differing(node))
    ]


def _remedy(node: NodeProcess, differing: Sequence[tuple[str, str, str]]) -> str:
    if any((name, there) == (_RANGE, _OFF) for name, there, _ in differing):
        return f'start {node.name} again after: export {_RANGE}=LOCALHOST'
    commands = '; '.join(
        f'export {name}={"LOCALHOST" if name == _RANGE else there}' for name, there, _ in differing
    )
    return f'to hear it, in this shell: {commands}'


def _differing(node: NodeProcess) -> list[tuple[str, str, str]]:
    """Name, value there and value here of each variable that separates."""
    pairs = [
        (name, node.variables.get(name) or default, os.environ.get(name) or default)
        for name, default in _DEFAULTS.items()
    ]
    return [
        (name, there, here)
        for name, there, here in pairs
        if there != here and (name != _RANGE or _OFF in (there, here))
    ]
