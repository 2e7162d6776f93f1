"""Starts a node and ends it cleanly: Ctrl-C gives exit code 0, an error one line, no traceback."""

from __future__ import annotations

import logging
import os
import signal
import sys
import time
from contextlib import ExitStack, suppress
from importlib import import_module, resources
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.executors import Executor

    from nanorocks_ros.nodes.base.node import NanorocksNode

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
"""The executables; each is a module of this package."""

_PROFILES_VARIABLE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
_SPIN_S = 0.2
# A node that has not ended by then hangs: the next signal ends it, [s].
_PATIENCE_S = 8.0


class _Interrupts:
    """Notes Ctrl-C and SIGTERM instead of raising an exception in the middle of some code.

    Such an exception gets lost in a destructor, or leaves a context half shut down. While the node
    ends, and writes the last messages and the index of its recording, further signals are ignored:
    `ros2 launch` sends SIGTERM 5 s after SIGINT, and people press Ctrl-C twice.

    Attributes
    ----------
    requested : bool
        Whether the process was asked to end.
    first : str
        Name of the first signal; empty before.
    node : NanorocksNode or None
        The node that is told.
    exit_immediately : bool
        Whether to exit on the first signal: while a node is built, kernels compile for seconds,
        and there is nothing to clean up.
    """

    def __init__(self) -> None:
        self.requested = False
        self.first = ''
        self.node: NanorocksNode | None = None
        self.exit_immediately = False
        self._first_at = 0.0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._handle)

    def _handle(self, number: int, _: object) -> None:
        if self.exit_immediately:
            os._exit(0)
        now = time.monotonic()
        if not self.requested:
            self.requested, self._first_at = True, now
            self.first = signal.Signals(number).name
            if self.node is not None:
                self.node.interrupt()
        elif now - self._first_at > _PATIENCE_S:
            os._exit(128 + number)


def main(name: str) -> NoReturn:
    """Run a node, and end the process with its exit code.

    Nothing is left to do then. The teardown of the interpreter takes seconds on a busy machine,
    and in it a second signal would kill the process.

    Parameters
    ----------
    name : str
        One of `NODES`.
    """
    code = run(name)
    logging.shutdown()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def run(name: str) -> int:
    """Spin a node until it ends or is interrupted; the exit code.

    Parameters
    ----------
    name : str
        One of `NODES`. The module is imported only here, so that Ctrl-C is clean also during
        the seconds that the import takes.

    Returns
    -------
    int
        0 at the end or when interrupted, 1 for unusable input, 2 for wrong arguments.
    """
    interrupts = _Interrupts()
    # Before numpy is loaded: no array here is worth a second thread, which would wait for the
    # first on a machine whose cores are all in use.
    os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
    # Information of this package, only warnings of others.
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


def use_large_segments() -> None:
    """On a graph that stays on this host, pass 1080p frames in shared memory.

    With the default segment of Fast DDS, 0.5 MB, frames go in fragments over UDP; some are lost
    or wait for the next heartbeat. A graph over several hosts has to choose its transports itself.
    """
    if os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST':
        profiles = resources.files(__package__).joinpath('fastdds_large_images.xml')
        os.environ.setdefault(_PROFILES_VARIABLE, str(profiles))


def node_class(name: str) -> Callable[[], NanorocksNode]:
    """The class of a node; it takes no arguments.

    Parameters
    ----------
    name : str
        One of `NODES`.
    """
    module = import_module(f'nanorocks_ros.nodes.{name}')
    chosen: Callable[[], NanorocksNode] = getattr(module, f'{name.title().replace("_", "")}Node')
    return chosen


def _spin(name: str, interrupts: _Interrupts) -> int:
    make_node = node_class(name)
    if interrupts.requested:
        return 0
    interrupts.exit_immediately = True
    node = make_node()
    executor = _executor_for(node)
    executor.add_node(node)
    with ExitStack() as ending:
        # Each is called, whatever happens to the others; the last one here first.
        ending.callback(node.destroy_node)
        ending.callback(executor.shutdown)
        ending.callback(node.end_recording)
        ending.callback(node.end_helpers)
        node.check_parameters()
        interrupts.node = node
        interrupts.exit_immediately = False
        node.start_recording()
        while not node.done and not interrupts.requested:
            executor.spin_once(timeout_sec=_SPIN_S)
        if interrupts.first:
            # `python -m benchmarks signals` measures from here.
            node.get_logger().info(f'interrupted by {interrupts.first}')
    return node.exit_code


def _executor_for(node: NanorocksNode) -> Executor:
    """The executor of a node.

    Before each wait SingleThreadedExecutor makes a new set of everything that a node may wait
    for: with dozens of subscriptions that is most of the work. EventsExecutor does not, but it
    does not support guard conditions.
    """
    from rclpy.executors import SingleThreadedExecutor

    if node.subscribes_later:
        try:
            from rclpy.experimental.events_executor import EventsExecutor
        except ImportError:
            # Older patches of Jazzy.
            return SingleThreadedExecutor()
        return EventsExecutor()
    return SingleThreadedExecutor()
