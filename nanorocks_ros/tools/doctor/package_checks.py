"""Checks of Python and of the required libraries.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import platform
import sys
import sysconfig
from pathlib import Path
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
# Modules that come under several names, or with a system, where pip does not know them.
_MODULES = {'opencv-python-headless': 'cv2'}


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
                remedy=pip_install('--editable .'),
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
    versions = {requirement.name: _version(requirement.name) for requirement in requirements}
    missing = [each for each in requirements if versions[each.name] is None]
    other = [
        each
        for each in requirements
        if (version := versions[each.name]) is not None
        and not each.specifier.contains(version, prereleases=True)
    ]
    if not missing and not other:
        listed = ', '.join(f'{key} {value}' for key, value in sorted(versions.items()))
        return Finding(name=name, found=listed)
    found = [f'{each.name} is not installed' for each in missing]
    # What a distribution ships is often older than what is tested, and does.
    found += [
        f'{each.name} {versions[each.name]} is not tested, {each.specifier} is' for each in other
    ]
    return Finding(
        name=name,
        status=status if missing else Status.WARNING,
        found=f'{", ".join(found)}; for {purpose}',
        remedy=pip_install(
            ' '.join(f"'{each.name}{each.specifier}'" for each in (*missing, *other))
        ),
    )


def _version(name: str) -> str | None:
    """The version of a library; None where it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        if name not in _MODULES:
            return None
    try:
        return str(importlib.import_module(_MODULES[name]).__version__)
    except ImportError:
        return None


def pip_install(packages: str) -> str:
    """How to install something with this Python."""
    marker = Path(sysconfig.get_path('stdlib')) / 'EXTERNALLY-MANAGED'
    if sys.prefix == sys.base_prefix and marker.exists():
        return (
            f'pip install --break-system-packages {packages}, or in an environment of its own: '
            'python3 -m venv nanorocks && . nanorocks/bin/activate'
        )
    return f'pip install {packages}'
