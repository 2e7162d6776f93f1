"""The checks of the machine and its ROS, in their order.

Tested by ``test/tools/doctor/test_examination.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.tools.doctor import machine_checks, package_checks, ros_checks, ros_probe_client

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from nanorocks_ros.tools.doctor.findings import Finding


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
    yield machine_checks.live_page()
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
    yield from loaded
    if not names:
        return
    yield ros_checks.executables(names)
    announce('sending frames from process to process')
    yield ros_probe_client.loopback()
