"""The live page beside the pipeline: a child that ends with it, and that it can do without."""

from __future__ import annotations

import os
import signal
import subprocess

from nanorocks_ros.dashboard.page_process import node_command, with_token
from nanorocks_ros.settings import DashboardGraphSettings

_ENDS_WITHIN_S = 5.0


class LivePage:
    """The node `dashboard` in a process of its own, so that browsers never slow the graph.

    Parameters
    ----------
    node : NanorocksNode
    settings : DashboardSettings
    trays_file : str
    """

    def __init__(self, node, settings, trays_file):
        self._node = node
        graph = DashboardGraphSettings(trays_file=trays_file, parent=os.getpid())
        command = node_command(settings, graph, node.get_namespace())
        environment = with_token(os.environ, settings.token)
        # A session of its own, so that a Ctrl-C here reaches it once, from us.
        self._process = subprocess.Popen(command, env=environment, start_new_session=True)
        self._timer = node.create_timer(1.0, self._check, clock=node.steady_clock)

    def _check(self):
        if self._process.poll() is not None:
            self._timer.cancel()
            self._node.get_logger().error(
                f'the live page ended with code {self._process.returncode}, as it says above; '
                'the pipeline goes on without it'
            )

    def close(self):
        """End it, and wait."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(_ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
