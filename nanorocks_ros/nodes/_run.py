"""Starts a node and ends it cleanly: Ctrl-C is exit code 0, bad input one line, no traceback."""

from __future__ import annotations

import logging
import os
import signal
import sys
from importlib import import_module, resources

NODES = (
    'simulator',
    'bag_player',
    'preprocessor',
    'speed_estimator',
    'cluster_autocorrelator',
    'haff_fitter',
    'pipeline',
    'dashboard',
    'demo',
)

_PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'


class _Interrupts:
    """Notes Ctrl-C and SIGTERM instead of raising wherever the program happens to be.

    An exception out of the blue gets lost in a destructor, or leaves a context half shut down.
    The second Ctrl-C ends the process at once.
    """

    def __init__(self):
        self.asked = False
        # While a node is built, kernels may be compiling for seconds, and nothing is at stake.
        self.at_once = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number, _):
        if self.asked:
            os._exit(128 + number)
        if self.at_once:
            os._exit(0)
        self.asked = True


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
    interrupts = _Interrupts()
    # Before numpy is loaded: no array here is worth a second thread, which would wait for the
    # first on a machine whose cores are all in use.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # What the core has to say while it works; of others, warnings only.
    logging.basicConfig(format=f'{name}: %(message)s')
    logging.getLogger('nanorocks_ros').setLevel(logging.INFO)
    use_large_segments()
    import rclpy
    from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
    from rclpy.exceptions import NameValidationException
    from rclpy.signals import SignalHandlerOptions

    from nanorocks_ros.errors import ConfigurationError, NanorocksError

    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        return _spin(name, interrupts)
    except NanorocksError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2 if isinstance(error, ConfigurationError) else 1
    except (RCLError, UnknownROSArgsError, NameValidationException) as error:
        print(f'{name}: wrong ROS arguments: {str(error).splitlines()[0]}', file=sys.stderr)
        return 2
    finally:
        rclpy.try_shutdown()


def use_large_segments():
    """On a graph that stays on this host, hand 1080p frames over in shared memory.

    With Fast DDS's own segment of 0.5 MB they go in fragments over UDP, of which some are lost
    or wait for the next heartbeat. A graph that spans hosts has to choose its transports itself.
    """
    if os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST':
        profile = resources.files(__package__).joinpath('fastdds_large_images.xml')
        os.environ.setdefault(_PROFILES, str(profile))


def _executor(node):
    """What takes the messages of a node.

    The usual one makes a new set of all that a node may wait for before each wait: of a node
    that hears of dozens of topics that is most of the work. The other knows no guard conditions.
    """
    from rclpy.executors import SingleThreadedExecutor

    if node.hears_much:
        try:
            from rclpy.experimental.events_executor import EventsExecutor
        except ImportError:
            # Older patches of Jazzy.
            return SingleThreadedExecutor()
        return EventsExecutor()
    return SingleThreadedExecutor()


def _spin(name, interrupts):
    module = import_module(f'nanorocks_ros.nodes.{name}')
    if interrupts.asked:
        return 0
    interrupts.at_once = True
    node = getattr(module, f'{name.title().replace("_", "")}Node')()
    executor = _executor(node)
    executor.add_node(node)
    try:
        node.refuse_unknown_parameters()
        node.refuse_unheard_overrides()
        interrupts.at_once = False
        while not node.done and not interrupts.asked:
            executor.spin_once(timeout_sec=0.2)
        return node.exit_code
    finally:
        executor.shutdown()
        node.destroy_node()
