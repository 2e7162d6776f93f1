"""The checks of a running graph: its nodes, its topics, and nodes that are not in it.

Tested by ``test/tools/doctor/test_graph_checks.py``.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.tools.doctor.findings import Finding, Status, worst
from nanorocks_ros.tools.doctor.node_processes import unheard
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.products import ARRAY_TOPICS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.tools.doctor.node_processes import NodeProcess

_CAMERAS = {topics.RAW.name, topics.RAW_COMPRESSED.name}
_SYSTEM_TOPICS = {'/rosout', '/parameter_events', '/diagnostics', '/clock'}
# What a graph does without: a camera without camera_info, a film without a truth.
_OPTIONAL = {
    topic.name
    for topic in (topics.CAMERA_INFO, topics.TRUTH, topics.BEADS, topics.TAKEN, topics.EPOCH)
}
_NAMES = {topic.name for topic in topics.TOPICS}
_RESULTS = {topic.name for topic in ARRAY_TOPICS.values()}
_LEVELS = {0: Status.OK, 1: Status.WARNING, 2: Status.PROBLEM}


def examine_graph(answer: dict[str, Any], processes: Sequence[NodeProcess]) -> list[Finding]:
    """Check the running nodes and the connections between them.

    Parameters
    ----------
    answer : dict
        From `ros_probe_client.graph`.
    processes : sequence of NodeProcess
        The nodes that run on this machine.

    Returns
    -------
    list of Finding
        Nodes first, then topics; a warning where there is no node.
    """
    listed, reports = answer['topics'], answer['reports']
    outside = unheard(processes)
    near = [process for process in processes if process.is_near and not process.is_renamed]
    findings = [
        *(finding for report in reports for finding in _node_findings(report)),
        *_silent_nodes(_reporting(listed, reports), near),
        *(
            _topic_finding(topic, listed)
            for topic in listed
            if topic['name'] not in _SYSTEM_TOPICS
        ),
    ]
    if not findings and not outside:
        return [
            Finding(
                name='graph',
                status=Status.WARNING,
                found='no node was discovered',
                remedy='start one; compare ROS_DOMAIN_ID and ROS_AUTOMATIC_DISCOVERY_RANGE with '
                'those of its shell',
            )
        ]
    if findings and worst(findings) is Status.OK:
        # Another graph, which this one does not miss.
        outside = [replace(finding, status=Status.OK, remedy='') for finding in outside]
    return [*outside, *findings]


def _node_findings(report: dict[str, Any]) -> list[Finding]:
    """What a node says of itself: its worst problem, then the others."""
    status = _LEVELS.get(report['level'], Status.PROBLEM)
    findings = [_said(report['node'], status, report['message'])]
    findings += [_said(report['node'], Status.WARNING, text) for text in report['further']]
    return findings


def _said(node: str, status: Status, text: str) -> Finding:
    found, _, remedy = text.partition('; ')
    return Finding(name=node, status=status, found=found, remedy=remedy)


def _reporting(listed: list[dict[str, Any]], reports: list[dict[str, Any]]) -> Counter[str]:
    """How many nodes of each name report; two may have the same one."""
    senders = Counter(
        publisher['node']
        for topic in listed
        if topic['name'] == '/diagnostics'
        for publisher in topic['publishers']
    )
    counts: Counter[str] = Counter()
    for report in reports:
        counts[report['node'].rpartition('/')[2]] += max(senders[report['node']], 1)
    return counts


def _silent_nodes(heard: Counter[str], processes: Sequence[NodeProcess]) -> list[Finding]:
    """Nodes of this machine that should be heard, but did not report."""
    silent = []
    for name in sorted({process.name for process in processes}):
        pids = [str(process.pid) for process in processes if process.name == name]
        if heard[name] < len(pids):
            silent.append(
                Finding(
                    name=f'{name} (process {", ".join(pids)})',
                    status=Status.WARNING,
                    found='runs here, but has not reported its state, as nodes do once a second',
                    remedy='if it is still starting, run this again; otherwise it hangs: '
                    f'kill -KILL {pids[0]}, and start it again',
                )
            )
    return silent


def _topic_finding(topic: dict[str, Any], listed: list[dict[str, Any]]) -> Finding:
    name = topic['name']
    general = _split(name)[1]
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
    if not senders and general not in _OPTIONAL:
        remedy = _publisher_remedy(topic, listed)
        return Finding(name=name, status=Status.WARNING, found=found, remedy=remedy)
    if len(senders) > 1 and general in _CAMERAS:
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{found}: frames of {len(senders)} publishers are mixed',
            remedy='stop all but one, or start each in another namespace (-r __ns:=/NAME)',
        )
    if len(senders) > 1 and general in _RESULTS:
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{found}: results of {len(senders)} publishers are mixed',
            remedy='stop all but one, or start each graph in another namespace (-r __ns:=/NAME)',
        )
    return Finding(name=name, found=found)


def _publisher_remedy(topic: dict[str, Any], listed: list[dict[str, Any]]) -> str:
    """The name under which somebody publishes such messages unheard, or what to start."""
    name = topic['name']
    namespace, general = _split(name)
    unheard = [
        other['name']
        for other in listed
        if other['publishers'] and not other['subscriptions'] and other['types'] == topic['types']
    ]
    # Of the same name in another namespace, or of a camera driver, which has names of its own.
    names_there = {general, ''} if general in _CAMERAS else {general}
    alike = [other for other in unheard if _split(other)[1] in names_there]
    if alike and general:
        listeners = _node_names([each['node'] for each in topic['subscriptions']])
        return f'start {listeners} with --ros-args -r {name}:={alike[0]}'
    if not general:
        return 'start the publisher, remap the topic, or check the namespace'
    moved = '' if namespace == topics.NAMESPACE else f' --ros-args -r __ns:={namespace or "/"}'
    if general in _CAMERAS:
        command = f'ros2 run nanorocks_ros simulator{moved}'
        return f'start the camera; to try the graph: {command}'
    return f'ros2 run nanorocks_ros pipeline{moved}'


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


def _split(name: str) -> tuple[str, str]:
    """The namespace of a topic, and its name as `wire.topics` declares it; empty: another."""
    general = re.sub(r'/tray_\d+/', '/tray_{tray}/', name)
    own = max((each for each in _NAMES if general.endswith(f'/{each}')), key=len, default='')
    return general.removesuffix(f'/{own}'), own


def _node_names(nodes: list[str]) -> str:
    return ', '.join(sorted(set(nodes))) or 'no node'
