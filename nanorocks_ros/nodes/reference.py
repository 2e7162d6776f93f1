"""The reference of the nodes, asked of the nodes themselves.

``python -m nanorocks_ros.nodes.reference`` writes it; a test fails when it is stale. It has to be
made where ROS is, unlike the other generated pages.
"""

from __future__ import annotations

import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from nanorocks_ros.nodes._run import NODES

PAGE = 'docs/reference/node_reference.md'
_SAMPLE = 'bags/tray_1_sample'
_NOTE = '<!-- Made by `make docs` from the nodes; change those instead. -->\n\n'
_INTRODUCTION = """# Node reference

What each node subscribes to, publishes and serves, and which parameters it has, as the node
itself says after its start with tray 1; other trays come with the parameter `trays`. What a topic
carries stands in [topics.md](topics.md), what a parameter means, with its default and range, in
[parameters.md](parameters.md), how the nodes work together in [nodes.md](nodes.md). Names are
relative to the namespace, `/nanorocks` by default; `speed.*` stands for all parameters of that
name.

Every node also publishes `/diagnostics` and has `use_sim_time`; a quality of service is overridden
by `qos_overrides.TOPIC.subscription.POLICY` and `.publisher.POLICY`.
"""
# Of every node, by rclpy.
_OF_ALL = ('/rosout', '/parameter_events', '/diagnostics')
_PARAMETERS_OF_ALL = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


class _Kind(NamedTuple):
    """A node as it is started."""

    name: str
    parameters: tuple[str, ...] = ()
    remark: str = ''


_KINDS = (
    _Kind('simulator'),
    _Kind('simulator', ('whole_scene:=true',), 'with `whole_scene`'),
    _Kind('bag_player', (f'bag:={_SAMPLE}',), f'with `bag:={_SAMPLE}`'),
    _Kind('preprocessor'),
    _Kind('preprocessor', ('transport:=compressed',), 'with `transport:=compressed`'),
    _Kind('speed_estimator'),
    _Kind('cluster_autocorrelator'),
    _Kind('haff_fitter'),
    _Kind('dashboard', ('port:=0',), 'before any tray is published'),
    _Kind('pipeline', (), 'with `source:=simulator`, the default'),
    _Kind('pipeline', ('source:=topic',), 'with `source:=topic`'),
    _Kind('pipeline', ('source:=bag', f'bag:={_SAMPLE}'), 'with `source:=bag`'),
)
# `demo` starts all the others and has no topics of its own.
_OTHERS = tuple(_Kind(name) for name in NODES if name not in {'demo', *(k.name for k in _KINDS)})


class _Asked(NamedTuple):
    """What a node said."""

    doc: str
    subscribes: tuple[str, ...]
    publishes: tuple[str, ...]
    serves: tuple[str, ...]
    parameters: tuple[str, ...]


def _ask(kind):
    import rclpy

    arguments = [word for parameter in kind.parameters for word in ('-p', parameter)]
    rclpy.init(args=['--ros-args', *arguments] if arguments else [])
    try:
        module = import_module(f'nanorocks_ros.nodes.{kind.name}')
        node = getattr(module, f'{kind.name.title().replace("_", "")}Node')()
        try:
            return _said(node, module.__doc__)
        finally:
            node.destroy_node()
    finally:
        rclpy.shutdown()


def _said(node, doc):
    who = node.get_name(), node.get_namespace()
    own = node.get_fully_qualified_name()
    services = node.get_service_names_and_types_by_node(*who)
    parameters = sorted(node.get_parameters_by_prefix(''))
    return _Asked(
        doc=doc.splitlines()[0].removeprefix('Node: '),
        subscribes=_topics(node.get_subscriber_names_and_types_by_node(*who)),
        publishes=_topics(node.get_publisher_names_and_types_by_node(*who)),
        serves=tuple(
            f'`{name.replace(own, "~")}` ({", ".join(types)})'
            for name, types in sorted(services)
            if not any(one.startswith(('rcl_interfaces', 'type_description')) for one in types)
        ),
        parameters=_groups(
            parameter for parameter in parameters if not parameter.startswith(_PARAMETERS_OF_ALL)
        ),
    )


def _groups(names):
    """Names without a dot as they are, the others by what stands before it."""
    return tuple(sorted({re.sub(r'\..*', '.*', name) for name in names}))


def _topics(found):
    """Names relative to the namespace, and of any tray."""
    names = (name for name, _ in found if name not in _OF_ALL)
    return tuple(
        sorted({re.sub(r'^tray_\d', 'tray_K', name.removeprefix('/nanorocks/')) for name in names})
    )


def _listed(names):
    return ', '.join(f'`{name}`' for name in names) or 'nothing'


def page():
    """The page, from nodes that are started one after the other in this process."""
    text = _NOTE + _INTRODUCTION
    before = None
    for kind in (*_KINDS, *_OTHERS):
        asked = _ask(kind)
        if before is None or before.name != kind.name:
            known = ()
            text += f'\n## {kind.name}\n\n{asked.doc[0].upper()}{asked.doc[1:]}\n'
        text += f'\n**{kind.remark[0].upper()}{kind.remark[1:]}**\n' if kind.remark else ''
        text += f'\n- subscribes: {_listed(asked.subscribes)}\n'
        text += f'- publishes: {_listed(asked.publishes)}\n'
        if asked.serves:
            text += f'- serves: {", ".join(asked.serves)}\n'
        if asked.parameters != known:
            text += f'- parameters: {_listed(asked.parameters)}\n'
        before, known = kind, asked.parameters
    return text


def main(root):
    """Write the page into a source tree."""
    os.chdir(root)
    Path(PAGE).parent.mkdir(parents=True, exist_ok=True)
    Path(PAGE).write_text(page(), encoding='utf-8')


if __name__ == '__main__':
    # Nobody is to hear these nodes.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
    main(sys.argv[1] if len(sys.argv) > 1 else '.')
