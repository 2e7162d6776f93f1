"""The process of the live page: it ends with the pipeline, which can do without it."""

from __future__ import annotations

import os
import signal
import subprocess
from typing import TYPE_CHECKING

from nanorocks_ros.dashboard.page_process import node_command, with_token
from nanorocks_ros.settings import DashboardGraphSettings

if TYPE_CHECKING:
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.settings import DashboardSettings

_CHECK_S = 1.0
# It has nothing to save.
_ENDS_WITHIN_S = 0.5


class LivePageProcess:
    """The node `dashboard` in a process of its own, so that browsers never slow the graph.

    Parameters
    ----------
    node : NanorocksNode
    settings : DashboardSettings
    trays_file : str
    """

    def __init__(self, node: NanorocksNode, settings: DashboardSettings, trays_file: str) -> None:
        self._node = node
        graph = DashboardGraphSettings(trays_file=trays_file, parent=os.getpid())
        command = node_command(settings, graph, node.get_namespace())
        environment = with_token(os.environ, settings.token)
        # In a session of its own, a Ctrl-C of the terminal reaches it only through `close`.
        self._process = subprocess.Popen(command, env=environment, start_new_session=True)
        self._timer = node.create_timer(_CHECK_S, self._check, clock=node.steady_clock)

    def _check(self) -> None:
        if self._process.poll() is not None:
            self._timer.cancel()
            self._node.get_logger().error(
                f'the live page ended with exit code {self._process.returncode}, its error is '
                'above; the pipeline continues without it'
            )

    def interrupt(self) -> None:
        """Ask the process to end."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def close(self) -> None:
        """Wait until the process, which was asked to, has ended; kill it when that takes long."""
        try:
            self._process.wait(_ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
