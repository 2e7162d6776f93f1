"""Checks of the machine: disk, port, shared memory, socket buffers, kernels, OpenCV."""

from __future__ import annotations

import os
import shutil
import socket
import tempfile
from pathlib import Path

import nanorocks_ros
from nanorocks_ros.numerics.compilation.kernel_cache import cache_root
from nanorocks_ros.settings import DashboardSettings
from nanorocks_ros.tools.doctor import node_processes
from nanorocks_ros.tools.doctor.findings import Finding, Status
from nanorocks_ros.tools.doctor.left_segments import SHARED_MEMORY, left_bytes, removal_command
from nanorocks_ros.tools.doctor.package_checks import pip_install

_GB = 1e9
# A minute of 1080p JPEGs at quality 85 takes about half a gigabyte.
_MINUTE_GB = 0.5
_RECOMMENDED_GB = 5.0
# The shared-memory segment of one node, and the sum for a graph of six with a margin.
_SEGMENT_GB = 0.064
_SEGMENTS_GB = 0.5
_FRAME_BYTES = 1920 * 1080 * 3
_RECEIVE_BUFFER = Path('/proc/sys/net/core/rmem_max')


def disk() -> Finding:
    """Free space for recordings in the working folder."""
    folder = Path.cwd()
    if not _writable(folder):
        return Finding(
            name='disk',
            status=Status.PROBLEM,
            found=f'{folder} cannot be written',
            remedy='work in another folder: cd ~',
        )
    free = shutil.disk_usage(folder).free / _GB
    found = f'{free:.1f} GB free in {folder}'
    if free >= _RECOMMENDED_GB:
        return Finding(name='disk', found=found)
    too_small = free < _MINUTE_GB
    return Finding(
        name='disk',
        status=Status.PROBLEM if too_small else Status.WARNING,
        found=f'{found}; a minute of the camera takes about {_MINUTE_GB:g} GB',
        remedy='free some space, or work in another folder',
    )


def live_page() -> Finding:
    """Whether the port of the live page is free, or used by a live page."""
    name, settings = 'live page', DashboardSettings()
    where = f'port {settings.port} of {settings.host}'
    pages = node_processes.running(('dashboard',))
    with socket.socket() as probe:
        # As the server does, so that connections that have just ended do not count.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((settings.host, settings.port))
        except OSError as error:
            if pages:
                return Finding(name=name, found=f'{where}: a page runs, process {pages[0].pid}')
            other = settings.port + 1
            return Finding(
                name=name,
                status=Status.WARNING,
                found=f'{where}: {error.strerror}',
                remedy=f'nanorocks dashboard --port {other}; of the pipeline: '
                f'-p dashboard_port:={other}',
            )
    return Finding(name=name, found=f'{where} is free')


def shared_memory(folder: Path = SHARED_MEMORY) -> Finding:
    """Free shared memory for the segments that carry frames between nodes.

    Nodes that are killed leave theirs until the machine starts again.
    """
    name = 'shared memory'
    if not folder.is_dir():
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{folder} does not exist: frames of 1080p will be lost',
            remedy=f'mount a tmpfs on {folder}',
        )
    free = shutil.disk_usage(folder).free / _GB
    found = f'{free:.2f} GB free in {folder}'
    left = left_bytes(folder) / _GB
    if left >= _SEGMENTS_GB:
        return Finding(
            name=name,
            status=Status.WARNING if free >= _SEGMENT_GB else Status.PROBLEM,
            found=f'{found}; nodes that were killed left {left:.2f} GB there',
            remedy=removal_command(folder),
        )
    if free >= _SEGMENTS_GB and os.access(folder, os.W_OK):
        return Finding(name=name, found=found)
    blocked = free < _SEGMENT_GB or not os.access(folder, os.W_OK)
    return Finding(
        name=name,
        status=Status.PROBLEM if blocked else Status.WARNING,
        found=f'{found}; each node needs {_SEGMENT_GB:g} GB of writable memory',
        remedy='in a container: docker run --shm-size=1g; elsewhere, while no node runs: '
        f'rm {folder}/fastrtps_* {folder}/sem.fastrtps_*',
    )


def receive_buffer(path: Path = _RECEIVE_BUFFER) -> Finding:
    """Limit of the UDP receive buffer, which holds frames between machines."""
    name = 'socket buffers'
    try:
        size = int(path.read_text(encoding='ascii'))
    except (OSError, ValueError):
        return Finding(name=name, found=f'{path} cannot be read')
    found = f'net.core.rmem_max is {size} bytes'
    if size >= _FRAME_BYTES or os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST':
        return Finding(name=name, found=found)
    return Finding(
        name=name,
        status=Status.WARNING,
        found=f'{found}; a frame of 1080p has {_FRAME_BYTES}',
        remedy=f'between machines: sudo sysctl -w net.core.rmem_max={4 * _FRAME_BYTES}; on one: '
        'export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST',
    )


def compiled_kernels() -> Finding:
    """How many kernels are compiled, and whether they can be cached for the next start."""
    name = 'compiled kernels'
    package = Path(nanorocks_ros.__file__).parent
    places = [cache_root()]
    if 'NUMBA_CACHE_DIR' not in os.environ:
        places.append(package)
    usable = [place for place in places if _writable(place)]
    if usable:
        listed, missing = _listed_and_missing_kernels()
        counts = f'{listed - missing} of {listed} compiled, ' if listed else ''
        others = '; `nanorocks compile` compiles the others now' if missing else ''
        return Finding(name=name, found=f'{counts}cached in {usable[0]}{others}')
    return Finding(
        name=name,
        status=Status.WARNING,
        found=f'cannot be cached: {" and ".join(map(str, places))} cannot be written; every '
        'start compiles for a minute',
        remedy='export NUMBA_CACHE_DIR=/a/folder/of/yours',
    )


def _listed_and_missing_kernels() -> tuple[int, int]:
    """How many kernels commands and nodes use, and how many of them are not compiled."""
    try:
        from nanorocks_ros.tools.compilation.parallel_compilation import (
            listed_versions,
            missing_versions,
        )

        listed = listed_versions()
        return len(listed), len(missing_versions(listed))
    except ImportError:
        # Another check names the library that is missing.
        return 0, 0


def _writable(folder: Path) -> bool:
    """Whether a file can be written in a folder that exists or can be made."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def opencv() -> Finding:
    """The version of OpenCV and its number of threads."""
    try:
        import cv2
    except ImportError as error:
        return Finding(
            name='OpenCV',
            status=Status.PROBLEM,
            found=f'cannot be imported: {error}',
            remedy=pip_install('opencv-python-headless'),
        )
    cores = len(os.sched_getaffinity(0))
    return Finding(
        name='OpenCV',
        found=f'{cv2.__version__}, {cv2.getNumThreads()} threads on {cores} cores',
    )
