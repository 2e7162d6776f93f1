"""The checks of the machine, its ROS and a running graph, in their order.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from nanorocks_ros.tools.doctor import machine_checks, package_checks, ros_checks, ros_probe_client
from nanorocks_ros.tools.doctor.findings import Finding, Status
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.products import ARRAY_TOPICS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_CAMERAS = {topics.RAW.name, topics.RAW_COMPRESSED.name}
_SYSTEM_TOPICS = {'/rosout', '/parameter_events', '/diagnostics'}


def examine(announce: Callable[[str], None]) -> Iterator[Finding]:
    """Check this machine and its ROS.

    Parameters
    ----------
    announce : callable
        Called with the name of each check that takes seconds.

    Yields
    ------
    Finding
        Each as soon as its check is finished.
    """
    yield package_checks.python()
    yield from package_checks.libraries()
    yield machine_checks.opencv()
    yield machine_checks.compiled_kernels()
    yield machine_checks.disk()
    yield ros_checks.installation()
    if not ros_checks.has_ros():
        return
    yield ros_checks.bootstrap()
    yield ros_checks.domain()
    yield ros_checks.discovery()
    yield ros_checks.profile()
    yield machine_checks.shared_memory()
    yield machine_checks.receive_buffer()
    announce('loading ROS')
    loaded, names = ros_probe_client.imported()
    yield loaded
    if loaded.status is Status.PROBLEM:
        return
    yield ros_checks.executables(names)
    announce('sending frames from process to process')
    yield ros_probe_client.loopback()


def examine_graph(graph: list[dict[str, Any]]) -> list[Finding]:
    """Check the connections between the running nodes.

    Parameters
    ----------
    graph : list of dict
        The topics, from `ros_probe_client.graph`.

    Returns
    -------
    list of Finding
        One for each topic of the graph; a warning where there is no node.
    """
    if not graph:
        return [
            Finding(
                name='graph',
                status=Status.WARNING,
                found='no node was discovered',
                remedy='start one; compare ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE with '
                'those of its shell',
            )
        ]
    return [_topic_finding(topic) for topic in graph if topic['name'] not in _SYSTEM_TOPICS]


def _topic_finding(topic: dict[str, Any]) -> Finding:
    name = topic['name']
    senders = [publisher['node'] for publisher in topic['publishers']]
    listeners = [subscription['node'] for subscription in topic['subscriptions']]
    found = f'{_node_names(senders)} -> {_node_names(listeners)}'
    if topic['mismatches']:
        pairs = '; '.join(
            f'{mismatch["publisher"]} -> {mismatch["subscription"]}: {mismatch["reason"]}'
            for mismatch in topic['mismatches']
        )
        remedy = _mismatch_remedy(name, topic['mismatches'])
        return Finding(name=name, status=Status.PROBLEM, found=f'no data: {pairs}', remedy=remedy)
    if not senders:
        return Finding(
            name=name,
            status=Status.WARNING,
            found=found,
            remedy='start the publisher, remap the topic, or check the namespace',
        )
    if len(senders) > 1 and any(name.endswith(f'/{camera}') for camera in _CAMERAS):
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{found}: frames of {len(senders)} cameras are mixed',
            remedy='stop one, or start it in another namespace',
        )
    if len(senders) > 1 and _of_result(name):
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{found}: results of {len(senders)} nodes are mixed',
            remedy='stop all but one, or start each graph in another namespace (-r __ns:=/NAME)',
        )
    return Finding(name=name, found=found)


def _mismatch_remedy(name: str, mismatches: list[dict[str, Any]]) -> str:
    if any(mismatch['of_types'] for mismatch in mismatches):
        return (
            f'remap the topic of one of them (-r {name}:=/OTHER); for a camera set '
            'transport:=raw or transport:=compressed'
        )
    offered = {policy: value for pair in mismatches for policy, value in pair['offered'].items()}
    overrides = ' '.join(
        f'-p qos_overrides.{name}.subscription.{policy}:={value}'
        for policy, value in offered.items()
    )
    others = 'let the subscription request the offered QoS'
    return f'for our nodes: {overrides}; for other nodes: {others}' if overrides else others


def _of_result(name: str) -> bool:
    """Whether a topic is one of the results of a tray."""
    general = re.sub(r'/tray_\d+/', '/tray_{tray}/', name)
    return any(general.endswith(f'/{topic.name}') for topic in ARRAY_TOPICS.values())


def _node_names(nodes: list[str]) -> str:
    return ', '.join(sorted(nodes)) or 'no node'
