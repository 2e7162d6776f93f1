"""Findings of the checks of this machine.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """Severity of a finding."""

    OK = 'ok'
    WARNING = 'warning'
    PROBLEM = 'problem'


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """The result of one check.

    Parameters
    ----------
    name : str
        Name of the check.
    status : Status
        PROBLEM where a graph cannot run, WARNING where a part of it is impaired.
    found : str
        The state that was found.
    remedy : str
        What to do; empty for OK.
    """

    name: str
    status: Status = Status.OK
    found: str
    remedy: str = ''


def worst(findings: list[Finding]) -> Status:
    """The most severe status of all findings."""
    statuses = {finding.status for finding in findings}
    return next(
        (status for status in (Status.PROBLEM, Status.WARNING) if status in statuses), Status.OK
    )
