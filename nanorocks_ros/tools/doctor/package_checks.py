"""Checks of Python and of the required libraries.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import importlib.metadata
import platform
import sys
from typing import TYPE_CHECKING

from nanorocks_ros.tools.doctor.findings import Finding, Status

if TYPE_CHECKING:
    from packaging.requirements import Requirement

_PACKAGE = 'nanorocks_ros'
_OLDEST_PYTHON = (3, 10)
_DEVELOPER_EXTRAS = {'ros', 'test', 'dev', 'docs', 'messages'}
_PURPOSES = {
    'cluster': 'work on other machines (--scheduler)',
    'dashboard': 'the live page (nanorocks dashboard)',
    'jpeg': 'faster decoding of JPEG',
    'parquet': 'tables as .parquet files',
}


def python() -> Finding:
    """The version of the interpreter."""
    found = f'{platform.python_version()} at {sys.executable}'
    if sys.version_info < _OLDEST_PYTHON:
        return Finding(
            name='Python',
            status=Status.PROBLEM,
            found=found,
            remedy='use Python 3.10 or newer',
        )
    return Finding(name='Python', found=found)


def libraries() -> list[Finding]:
    """The required libraries, and those of each extra."""
    try:
        requirements = _requirements()
    except importlib.metadata.PackageNotFoundError:
        return [
            Finding(
                name='libraries',
                status=Status.WARNING,
                found=f'{_PACKAGE} runs from its source tree and is not installed',
                remedy='pip install --editable .',
            )
        ]
    needed = [requirement for requirement in requirements if _applies(requirement, '')]
    findings = [_library_finding('libraries', needed, Status.PROBLEM, 'everything')]
    extras = importlib.metadata.metadata(_PACKAGE).get_all('Provides-Extra') or []
    for extra in sorted(set(extras) - _DEVELOPER_EXTRAS):
        additional = [
            requirement
            for requirement in requirements
            if _applies(requirement, extra) and requirement not in needed
        ]
        # An extra of the previous release may be empty.
        if additional:
            purpose = _PURPOSES.get(extra, 'an extra')
            finding = _library_finding(f'extra [{extra}]', additional, Status.WARNING, purpose)
            findings.append(finding)
    return findings


def _requirements() -> list[Requirement]:
    from packaging.requirements import Requirement

    return [Requirement(line) for line in importlib.metadata.requires(_PACKAGE) or []]


def _applies(requirement: Requirement, extra: str) -> bool:
    return requirement.marker is None or requirement.marker.evaluate({'extra': extra})


def _library_finding(
    name: str, requirements: list[Requirement], status: Status, purpose: str
) -> Finding:
    versions: dict[str, str] = {}
    missing = {}
    for requirement in requirements:
        try:
            versions[requirement.name] = importlib.metadata.version(requirement.name)
        except importlib.metadata.PackageNotFoundError:
            missing[requirement.name] = f'{requirement.name} is not installed'
            continue
        if not requirement.specifier.contains(versions[requirement.name], prereleases=True):
            missing[requirement.name] = (
                f'{requirement.name} {versions[requirement.name]} is not {requirement.specifier}'
            )
    if not missing:
        listed = ', '.join(f'{key} {value}' for key, value in sorted(versions.items()))
        return Finding(name=name, found=listed)
    packages = ' '.join(
        f"'{requirement.name}{requirement.specifier}'"
        for requirement in requirements
        if requirement.name in missing
    )
    return Finding(
        name=name,
        status=status,
        found=f'{", ".join(missing.values())}; for {purpose}',
        remedy=f'pip install {packages}',
    )
