"""Nodes forked from a process that has imported all of them: of a start, the imports take longest.

What a start is by itself, `python -m nanorocks_ros.nodes`, is tested with programs.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
from multiprocessing import resource_tracker
from pathlib import Path

from nanorocks_ros.nodes.run import NODES

_FORKS = multiprocessing.get_context('forkserver')
_FORKS.set_forkserver_preload([f'nanorocks_ros.nodes.{name}' for name in NODES])


class ForkedNode:
    """A node in a process of its own, with the methods of `subprocess.Popen` that tests use."""

    def __init__(self, arguments, environment, log):
        # Read when the library is loaded.
        os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
        # Tests read it before the node has begun.
        Path(log).touch()
        self._process = _FORKS.Process(
            target=_run, args=(arguments, environment, os.getcwd(), log), daemon=False
        )
        self._process.start()
        self.pid = self._process.pid

    @property
    def returncode(self):
        return self._process.exitcode

    def poll(self):
        return self._process.exitcode

    def wait(self, timeout=None):
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired('node', timeout)
        return self._process.exitcode

    def send_signal(self, number):
        # One that just ended is gone before its exit code is known here.
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


def _run(arguments, environment, folder, log):
    """Become the program of a node."""
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    # One of its own, as a program has, which ends with it.
    tracker = resource_tracker._resource_tracker
    tracker._fd = tracker._pid = None
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for number, stream in ((1, sys.stdout), (2, sys.stderr)):
        os.dup2(descriptor, number)
        stream.reconfigure(write_through=True)
    os.close(descriptor)
    sys.argv = ['nanorocks_ros.nodes', *arguments]
    runpy.run_module('nanorocks_ros.nodes', run_name='__main__', alter_sys=True)
