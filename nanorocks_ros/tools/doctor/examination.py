"""The examination: every point in turn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.tools.doctor import machine_checks, package_checks, ros_checks, ros_probe_client
from nanorocks_ros.tools.doctor.findings import Finding, Status
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_CAMERAS = {topics.RAW.name, topics.RAW_COMPRESSED.name}
_OF_ALL = {'/rosout', '/parameter_events', '/diagnostics'}


def examine(announce: Callable[[str], None]) -> Iterator[Finding]:
    """Look at this machine and its ROS.

    Parameters
    ----------
    announce : callable
        Told what is being done where that takes seconds.

    Yields
    ------
    Finding
        As soon as it is known.
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


def examine_graph(found: list[dict[str, Any]]) -> list[Finding]:
    """What is wrong between the nodes that run now.

    Parameters
    ----------
    found : list of dict
        As `children.graph` returns it.

    Returns
    -------
    list of Finding
        One for each topic of the graph.
    """
    if not found:
        return [
            Finding(
                name='graph',
                status=Status.WARNING,
                found='no node is heard',
                remedy='start one; compare ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE with '
                'those of its shell',
            )
        ]
    return [_topic_finding(topic) for topic in found if topic['name'] not in _OF_ALL]


def _topic_finding(topic: dict[str, Any]) -> Finding:
    name = topic['name']
    senders = [publisher['node'] for publisher in topic['publishers']]
    listeners = [subscription['node'] for subscription in topic['subscriptions']]
    found = f'{_named(senders)} -> {_named(listeners)}'
    if topic['mismatches']:
        pairs = '; '.join(
            f'{mismatch["publisher"]} -> {mismatch["subscription"]}: {mismatch["reason"]}'
            for mismatch in topic['mismatches']
        )
        return Finding(
            name=name,
            status=Status.PROBLEM,
            found=f'no data: {pairs}',
            remedy=f'of our nodes: -p qos_overrides.{name}.subscription.reliability:=best_effort, '
            'or .durability:=volatile; of others: ask for what is offered',
        )
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
            found=f'{found}: frames of {len(senders)} cameras mix',
            remedy='end one, or move it into a namespace of its own',
        )
    return Finding(name=name, found=found)


def _named(nodes: list[str]) -> str:
    return ', '.join(sorted(nodes)) or 'nobody'
