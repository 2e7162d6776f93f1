"""Starts a node and ends it cleanly: Ctrl-C is exit code 0, bad input one line, no traceback."""

from __future__ import annotations

import os
import sys
from importlib import resources

NODES = (
    'simulator',
    'bag_player',
    'preprocessor',
    'speed_estimator',
    'cluster_autocorrelator',
    'haff_fitter',
    'pipeline',
    'demo',
)

_PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'


def run(name):
    """Spin a node until it ends or is interrupted; the exit code.

    Parameters
    ----------
    name : str
        One of `NODES`: a module here, imported only now so that Ctrl-C during the seconds
        which that takes is as clean as later.

    Returns
    -------
    int
        0 at the end or when interrupted, 1 for input that cannot be used, 2 for a wrong call.
    """
    try:
        _use_large_segments()
        return _spin(name)
    except KeyboardInterrupt:
        return 0


def _use_large_segments():
    """On a graph that stays on this host, hand 1080p frames over in shared memory.

    With Fast DDS's own segment of 0.5 MB they go in fragments over UDP, of which some are lost
    or wait for the next heartbeat. A graph that spans hosts has to choose its transports itself.
    """
    if os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST':
        profile = resources.files(__package__).joinpath('fastdds_large_images.xml')
        os.environ.setdefault(_PROFILES, str(profile))


def _spin(name):
    from importlib import import_module

    import rclpy
    from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
    from rclpy.exceptions import ROSInterruptException
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    from nanorocks_ros.errors import ConfigurationError, NanorocksError

    node = None
    try:
        module = import_module(f'nanorocks_ros.nodes.{name}')
        node_class = getattr(module, f'{name.title().replace("_", "")}Node')
        rclpy.init(args=sys.argv)
        node = node_class()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not node.done:
            executor.spin_once(timeout_sec=0.2)
    except (KeyboardInterrupt, ExternalShutdownException, ROSInterruptException):
        return 0
    except NanorocksError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2 if isinstance(error, ConfigurationError) else 1
    except (RCLError, UnknownROSArgsError) as error:
        # Context shut down under us: the same as Ctrl-C. Anything else: wrong ROS arguments.
        if node is not None and not rclpy.ok():
            return 0
        print(f'{name}: wrong ROS arguments: {str(error).splitlines()[0]}', file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return node.exit_code
