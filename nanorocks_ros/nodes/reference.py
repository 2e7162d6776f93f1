"""The page `docs/reference/node_reference.md`, generated from running nodes.

``python -m nanorocks_ros.nodes.reference`` writes it; a test fails when it is stale. Unlike the
other generated pages it needs ROS.
"""

from __future__ import annotations

import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.nodes.base.node import NanorocksNode

from nanorocks_ros.nodes.run import NODES

PAGE = 'docs/reference/node_reference.md'
_SAMPLE = 'bags/tray_1_sample'
_NOTE = '<!-- Made by `make docs` from the nodes; change those instead. -->\n\n'
_INTRODUCTION = """# Node reference

For each node: the topics that it subscribes to and publishes, its services, and its parameters,
read from the running node with tray 1; the parameter `trays` chooses other trays.
[topics.md](topics.md) describes the messages, [parameters.md](parameters.md) the parameters with
defaults and ranges, [nodes.md](nodes.md) how the nodes work together. Names are relative to the
namespace, `/nanorocks` by default; `speed.*` stands for all parameters that begin with `speed.`.

Every node also publishes `/diagnostics` and has `use_sim_time`; the parameters
`qos_overrides.TOPIC.subscription.POLICY` and `.publisher.POLICY` override a quality of service.
"""
# Topics and parameters of every node, by rclpy or NanorocksNode.
_COMMON_TOPICS = ('/rosout', '/parameter_events', '/diagnostics')
_COMMON_PARAMETERS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


class _Start(NamedTuple):
    """A way to start a node."""

    name: str
    parameters: tuple[str, ...] = ()
    remark: str = ''


_STARTS = (
    _Start('simulator'),
    _Start('simulator', ('whole_scene:=true',), 'with `whole_scene`'),
    _Start('bag_player', (f'bag:={_SAMPLE}',), f'with `bag:={_SAMPLE}`'),
    _Start('preprocessor'),
    _Start('preprocessor', ('transport:=compressed',), 'with `transport:=compressed`'),
    _Start('speed_estimator'),
    _Start('cluster_autocorrelator'),
    _Start('haff_fitter'),
    _Start('dashboard', ('port:=0',), 'before any tray is published'),
    _Start('pipeline', (), 'with `source:=simulator`, the default'),
    _Start('pipeline', ('source:=topic',), 'with `source:=topic`'),
    _Start('pipeline', ('source:=bag', f'bag:={_SAMPLE}'), 'with `source:=bag`'),
)
# `demo` starts all the others and has no topics of its own.
_OTHER_STARTS = tuple(
    _Start(name) for name in NODES if name not in {'demo', *(start.name for start in _STARTS)}
)


class _Interface(NamedTuple):
    """What a node offers and uses."""

    summary: str
    subscribed: tuple[str, ...]
    published: tuple[str, ...]
    services: tuple[str, ...]
    parameters: tuple[str, ...]


def _interface_of(start: _Start) -> _Interface:
    """Start a node, ask it, and end it."""
    import rclpy

    from nanorocks_ros.nodes.run import node_class

    arguments = [word for rule in start.parameters for word in ('-p', rule)]
    rclpy.init(args=['--ros-args', *arguments] if arguments else [])
    try:
        make_node = node_class(start.name)
        node = make_node()
        try:
            return _read_interface(node, import_module(make_node.__module__).__doc__ or '')
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown()


def _read_interface(node: NanorocksNode, doc: str) -> _Interface:
    name, namespace = node.get_name(), node.get_namespace()
    full_name = node.get_fully_qualified_name()
    services = node.get_service_names_and_types_by_node(name, namespace)
    parameters = sorted(node.get_parameters_by_prefix(''))
    return _Interface(
        summary=doc.splitlines()[0].removeprefix('Node: '),
        subscribed=_topics(node.get_subscriber_names_and_types_by_node(name, namespace)),
        published=_topics(node.get_publisher_names_and_types_by_node(name, namespace)),
        services=tuple(
            f'`{service.replace(full_name, "~")}` ({", ".join(types)})'
            for service, types in sorted(services)
            if not any(kind.startswith(('rcl_interfaces', 'type_description')) for kind in types)
        ),
        parameters=_groups(
            parameter for parameter in parameters if not parameter.startswith(_COMMON_PARAMETERS)
        ),
    )


def _groups(names: Iterable[str]) -> tuple[str, ...]:
    """Names without a dot as they are, the others by what is before the dot."""
    return tuple(sorted({re.sub(r'\..*', '.*', name) for name in names}))


def _topics(names_and_types: Iterable[tuple[str, list[str]]]) -> tuple[str, ...]:
    """Names relative to the namespace, with K for the number of a tray."""
    names = (name for name, _ in names_and_types if name not in _COMMON_TOPICS)
    return tuple(
        sorted({re.sub(r'^tray_\d', 'tray_K', name.removeprefix('/nanorocks/')) for name in names})
    )


def _listed(names: Iterable[str]) -> str:
    return ', '.join(f'`{name}`' for name in names) or 'nothing'


def _capitalized(text: str) -> str:
    return text[0].upper() + text[1:]


def page() -> str:
    """The page, from nodes that are started one after the other in this process."""
    text = _NOTE + _INTRODUCTION
    last_name = ''
    shown_parameters: tuple[str, ...] = ()
    for start in (*_STARTS, *_OTHER_STARTS):
        interface = _interface_of(start)
        if start.name != last_name:
            shown_parameters = ()
            text += f'\n## {start.name}\n\n{_capitalized(interface.summary)}\n'
        text += f'\n**{_capitalized(start.remark)}**\n' if start.remark else ''
        text += f'\n- subscribes: {_listed(interface.subscribed)}\n'
        text += f'- publishes: {_listed(interface.published)}\n'
        if interface.services:
            text += f'- serves: {", ".join(interface.services)}\n'
        if interface.parameters != shown_parameters:
            text += f'- parameters: {_listed(interface.parameters)}\n'
        last_name, shown_parameters = start.name, interface.parameters
    return text


def main(root: str) -> None:
    """Write the page into a source tree."""
    os.chdir(root)
    Path(PAGE).parent.mkdir(parents=True, exist_ok=True)
    Path(PAGE).write_text(page(), encoding='utf-8')


if __name__ == '__main__':
    # No other node may discover these nodes.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    main(sys.argv[1] if len(sys.argv) > 1 else '.')
