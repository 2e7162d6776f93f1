"""Checks of ROS 2: its installation, its variables, its executables; without importing it.

Tested by ``test/tools/doctor/test_machine_checks.py``.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import sys
from pathlib import Path

from nanorocks_ros.tools.doctor.findings import Finding, Status
from nanorocks_ros.tools.doctor.package_checks import pip_install

_PACKAGE = 'nanorocks_ros'
_DISTRIBUTION = 'jazzy'
_BOOTSTRAP = '_ROS_WHEELS_BOOTSTRAP_COMPLETE'
_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')
# Above it the ports of the domain overlap the ephemeral ports of the system.
_LAST_SAFE_DOMAIN = 101
_LAST_DOMAIN = 232


def has_ros() -> bool:
    """Whether rclpy is installed."""
    return importlib.util.find_spec('rclpy') is not None


def has_wheels() -> bool:
    """Whether ROS is installed from wheels."""
    try:
        importlib.metadata.distribution('ros-rclpy')
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def installation() -> Finding:
    """The installation of ROS 2: wheels or a sourced one, never both."""
    sourced, wheels = os.environ.get('ROS_DISTRO'), has_wheels()
    if not has_ros():
        return Finding(
            name='ROS 2',
            status=Status.PROBLEM,
            found='not installed: nodes cannot run; the offline commands can',
            remedy='source /opt/ros/jazzy/setup.bash, or ' + pip_install("'nanorocks_ros[ros]'"),
        )
    if sourced and wheels:
        return Finding(
            name='ROS 2',
            status=Status.PROBLEM,
            found=f'{sourced} is sourced, and wheels of ROS are in {sys.prefix}: their '
            'libraries conflict',
            remedy='use a shell without a sourced ROS, or an environment without the wheels',
        )
    if sourced and sourced != _DISTRIBUTION:
        return Finding(
            name='ROS 2',
            status=Status.WARNING,
            found=f'{sourced} is sourced; the nodes are tested with {_DISTRIBUTION}',
            remedy=f'source /opt/ros/{_DISTRIBUTION}/setup.bash',
        )
    where = f'{sourced}, sourced' if sourced else f'{_DISTRIBUTION}, wheels in {sys.prefix}'
    return Finding(name='ROS 2', found=where)


def bootstrap() -> Finding:
    """Whether the libraries of the ROS wheels are on the library path."""
    name = 'libraries of the wheels'
    if not has_wheels():
        return Finding(name=name, found='no wheels')
    paths = os.environ.get('LD_LIBRARY_PATH', '').split(os.pathsep)
    own = Path(sys.prefix) / 'lib'
    if str(own) in paths:
        return Finding(name=name, found=f'on LD_LIBRARY_PATH, with {own}')
    return Finding(
        name=name,
        status=Status.PROBLEM,
        found=f'{_BOOTSTRAP} was set by another Python: the libraries of {sys.prefix} are not on '
        'LD_LIBRARY_PATH',
        remedy=f'unset {_BOOTSTRAP}',
    )


def domain() -> Finding:
    """Whether the DDS domain is valid."""
    name = 'ROS_DOMAIN_ID'
    text = os.environ.get(name, '')
    if not text:
        return Finding(name=name, found='not set: 0')
    if not text.isdecimal() or int(text) > _LAST_DOMAIN:
        return Finding(
            name=name,
            status=Status.PROBLEM,
            found=f'{text!r} is not a valid domain',
            remedy=f'export {name}=0, or another up to {_LAST_SAFE_DOMAIN}',
        )
    if int(text) > _LAST_SAFE_DOMAIN:
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{text}: its ports may be used by other programs',
            remedy=f'use one up to {_LAST_SAFE_DOMAIN}',
        )
    return Finding(name=name, found=text)


def discovery() -> Finding:
    """Whether the discovery range is valid."""
    value = os.environ.get(_RANGE, '')
    if os.environ.get('ROS_LOCALHOST_ONLY') == '1':
        return Finding(
            name=_RANGE,
            status=Status.WARNING,
            found='ROS_LOCALHOST_ONLY=1, which is deprecated, overrides it',
            remedy=f'unset ROS_LOCALHOST_ONLY; export {_RANGE}=LOCALHOST',
        )
    ranges = ('SUBNET', 'LOCALHOST', 'OFF', 'SYSTEM_DEFAULT')
    if value and value not in ranges:
        return Finding(
            name=_RANGE,
            status=Status.WARNING,
            found=f'{value!r} is none of {", ".join(ranges)}, and is taken as SUBNET',
            remedy=f'export {_RANGE}=LOCALHOST',
        )
    if value == 'OFF':
        return Finding(
            name=_RANGE,
            status=Status.PROBLEM,
            found='OFF: nodes do not discover each other',
            remedy=f'export {_RANGE}=LOCALHOST',
        )
    return Finding(name=_RANGE, found=value or 'not set: SUBNET, visible in the whole network')


def profile() -> Finding:
    """Whether a Fast DDS profile sends frames of 1080p through shared memory."""
    name = 'Fast DDS profile'
    rmw = os.environ.get('RMW_IMPLEMENTATION') or 'rmw_fastrtps_cpp'
    if 'fastrtps' not in rmw:
        return Finding(
            name=name, found=f'not used by {rmw}; the nodes are measured with rmw_fastrtps_cpp'
        )
    chosen = next((os.environ[key] for key in _PROFILES if os.environ.get(key)), '')
    if chosen and not Path(chosen).is_file():
        return Finding(
            name=name,
            status=Status.PROBLEM,
            found=f'{chosen} does not exist',
            remedy=f'unset {" ".join(_PROFILES)}',
        )
    if chosen:
        return Finding(name=name, found=chosen)
    if os.environ.get(_RANGE) == 'LOCALHOST':
        return Finding(name=name, found='profile of the package: segments of 64 MB')
    return Finding(
        name=name,
        status=Status.WARNING,
        found=f'none, since {_RANGE} is not LOCALHOST: frames of 1080p are fragmented over UDP',
        remedy=f'on one machine: export {_RANGE}=LOCALHOST; between machines set your own '
        f'profile in {_PROFILES[-1]}',
    )


def executables(names: tuple[str, ...]) -> Finding:
    """Whether ``ros2 run`` finds the executables on AMENT_PREFIX_PATH."""
    name = 'executables'
    prefixes = [Path(part) for part in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    marker = Path('share/ament_index/resource_index/packages') / _PACKAGE
    installed = [
        prefix for prefix in prefixes if prefix.is_absolute() and (prefix / marker).is_file()
    ]
    installed_here = (Path(sys.prefix) / marker).is_file()
    remedy = (
        f'export AMENT_PREFIX_PATH={sys.prefix}'
        if installed_here
        else 'source install/setup.bash of the colcon workspace'
    )
    alternative = 'python -m nanorocks_ros.nodes NAME works as well'
    if not installed:
        return Finding(
            name=name,
            status=Status.WARNING,
            found='ros2 run finds none: the package is on no prefix of AMENT_PREFIX_PATH',
            remedy=f'{remedy}; {alternative}',
        )
    folder = installed[0] / 'lib' / _PACKAGE
    missing = [program for program in names if not os.access(folder / program, os.X_OK)]
    if missing:
        return Finding(
            name=name,
            status=Status.WARNING,
            found=f'{", ".join(missing)} cannot be run in {folder}',
            remedy=f'install again; {alternative}',
        )
    return Finding(name=name, found=f'{len(names)} in {folder}')
