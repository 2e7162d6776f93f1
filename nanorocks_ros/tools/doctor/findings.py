"""What an examination of this machine has found, point by point."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """How good a finding is."""

    OK = 'ok'
    WARNING = 'warning'
    PROBLEM = 'problem'


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One point that was looked at.

    Parameters
    ----------
    name : str
        Of the point.
    status : Status
        PROBLEM where the graph cannot be used, WARNING where part of it suffers.
    found : str
        What is there.
    remedy : str
        What to do about it; empty where nothing is to be done.
    """

    name: str
    status: Status = Status.OK
    found: str
    remedy: str = ''


def worst(findings: list[Finding]) -> Status:
    """The status of the whole."""
    statuses = {finding.status for finding in findings}
    return next((one for one in (Status.PROBLEM, Status.WARNING) if one in statuses), Status.OK)
