"""``nanorocks doctor``: problems of this machine or of the running graph, with remedies."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import argparse

    from nanorocks_ros.tools.doctor.findings import Finding

_EXIT_PROBLEM = 1


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'doctor', help='check this machine, its ROS and its libraries, and name remedies'
    )
    parser.add_argument(
        '--graph',
        action='store_true',
        help='check the running nodes instead: what they report, their topics and connections',
    )
    parser.add_argument(
        '--seconds', type=float, default=5.0, help='with --graph: time to listen; default 5'
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the checks and print the findings; 1 where a graph cannot run, else 0."""
    from nanorocks_ros.outputs.safe_text import counted
    from nanorocks_ros.tools.doctor.findings import Status, worst

    findings = _graph_findings(options) if options.graph else _machine_findings(options)
    verdict = worst(findings)
    if options.json:
        checks = [
            {
                'name': finding.name,
                'status': finding.status.value,
                'found': finding.found,
                'remedy': finding.remedy or None,
            }
            for finding in findings
        ]
        print(json.dumps({'status': verdict.value, 'checks': checks}))
    else:
        counts = [sum(finding.status is status for finding in findings) for status in Status]
        ok, warnings, problems = counts
        print(f'{ok} ok, {counted(warnings, "warning")}, {counted(problems, "problem")}')
    return _EXIT_PROBLEM if verdict is Status.PROBLEM else 0


def _machine_findings(options: argparse.Namespace) -> list[Finding]:
    from nanorocks_ros.tools.doctor.examination import examine

    findings = []
    for finding in examine(_announce):
        findings.append(finding)
        if not options.json:
            _print(finding)
    return findings


def _graph_findings(options: argparse.Namespace) -> list[Finding]:
    from nanorocks_ros.errors import ConfigurationError
    from nanorocks_ros.tools.doctor import node_processes
    from nanorocks_ros.tools.doctor.graph_checks import examine_graph
    from nanorocks_ros.tools.doctor.ros_probe_client import graph

    if not 0.0 < options.seconds <= 10.0:
        raise ConfigurationError('--seconds', f'{options.seconds:g}', 'give 0.1 to 10')
    _announce('listening')
    answer = graph(options.seconds)
    findings = examine_graph(answer, node_processes.running(answer['executables']))
    if not options.json:
        for finding in findings:
            _print(finding)
    return findings


def _announce(text: str) -> None:
    if sys.stderr.isatty():
        print(f'nanorocks: {text} ...', file=sys.stderr)


def _print(finding: Finding) -> None:
    print(f'{finding.status.value:8} {finding.name}: {finding.found}', flush=True)
    if finding.remedy:
        print(f'{"":8}   {finding.remedy}', flush=True)
