"""Nodes in processes of their own, on a domain that no other test uses, on this host only."""

from __future__ import annotations

import itertools
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field

import pytest

pytest.importorskip('rclpy')

import rclpy
from forked_nodes import ForkedNode
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.base.node import NanorocksNode
from nanorocks_ros.pipeline.warm_up import warm_up, warm_up_counting, warm_up_speed
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.tools.doctor.left_segments import remove_left_segments

_PATIENCE_S = 40.0
# Higher domains use ports that the system gives to other programs.
_LAST_DOMAIN = 101


def _domains():
    """Domains of this process, in an order that differs between two runs at the same time."""
    workers = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
    own = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    numbers = [domain for domain in range(1, _LAST_DOMAIN + 1) if domain % workers == own]
    random.Random(os.getpid()).shuffle(numbers)
    return itertools.cycle(numbers)


_DOMAINS = _domains()


@pytest.fixture
def domain():
    """A ROS domain that no other test uses."""
    return next(_DOMAINS)


@pytest.fixture(scope='session', autouse=True)
def compiled_simulation():
    """Compile engine and preprocessing, before two nodes do so while a test waits for them."""
    settings = SimulationSettings(first_shake=0.0)
    for _ in film(settings, load_trays()[1], frames=2):
        pass
    warm_up()
    warm_up_counting()
    warm_up_speed()


@pytest.fixture(scope='session', autouse=True)
def _no_left_memory():
    """Free the shared memory of nodes that tests killed: many runs fill that of the machine."""
    yield
    remove_left_segments()


@dataclass
class Finished:
    """How a node ended."""

    code: int
    output: str


@dataclass
class Graph:
    """The processes of one test, and a node that listens to them."""

    domain: int
    node: Node
    executor: SingleThreadedExecutor
    folder: str
    _running: list[tuple[subprocess.Popen | ForkedNode, str]] = field(default_factory=list)

    def start(self, name, *parameters, arguments=()):
        """Start a node, without the time that imports take; parameters as ``name:=value``."""
        words, environment, path = self._call(name, parameters, arguments)
        process = ForkedNode(words, environment, path)
        self._running.append((process, path))
        return process

    def start_program(self, name, *parameters, arguments=()):
        """Start a node as a user does: where its command line or its imports matter."""
        words, environment, path = self._call(name, parameters, arguments)
        command = [sys.executable, '-m', 'nanorocks_ros.nodes', *words]
        with open(path, 'wb') as log:
            process = subprocess.Popen(
                command, env=environment, stdout=log, stderr=subprocess.STDOUT
            )
        self._running.append((process, path))
        return process

    def _call(self, name, parameters, arguments):
        """Words and environment of a node, and the file of what it prints."""
        words = [name, '--ros-args', *arguments]
        for parameter in parameters:
            words += ['-p', parameter]
        environment = dict(
            os.environ,
            ROS_DOMAIN_ID=str(self.domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
            PYTHONUNBUFFERED='1',
        )
        return words, environment, os.path.join(self.folder, f'{name}_{len(self._running)}.log')

    def output(self, process):
        """What a node has printed so far."""
        path = next(path for running, path in self._running if running is process)
        with open(path, encoding='utf-8') as log:
            return log.read()

    def wait(self, process):
        """Spin until a node has ended by itself."""
        self.until(lambda: process.poll() is not None)
        return Finished(process.returncode, self.output(process))

    def interrupt(self, process):
        """Press Ctrl-C and wait for the end."""
        process.send_signal(signal.SIGINT)
        process.wait(_PATIENCE_S)
        return Finished(process.returncode, self.output(process))

    def until(self, condition, patience_s=_PATIENCE_S):
        """Spin until a condition holds; fail with what the nodes printed if it never does."""
        end = time.monotonic() + patience_s
        while not condition():
            if time.monotonic() > end:
                logs = '\n'.join(self.output(process) for process, _ in self._running)
                pytest.fail(f'the condition never came true; output of the nodes:\n{logs}')
            self.executor.spin_once(timeout_sec=0.05)

    def end(self):
        """End what is still running."""
        for process, _ in self._running:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process, _ in self._running:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@pytest.fixture
def graph(tmp_path, monkeypatch, domain):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = Node('listener', context=context, namespace='nanorocks')
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    running = Graph(domain=domain, node=node, executor=executor, folder=str(tmp_path))
    yield running
    running.end()
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


@pytest.fixture
def spun():
    """A node in this process, and a function that spins it until a condition holds."""
    context = Context()
    rclpy.init(context=context)
    node = Node('spun', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin_until(condition):
        end = time.monotonic() + 20.0
        while not condition() and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert condition()

    yield node, spin_until
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture
def own_node(domain, monkeypatch):
    """A NanorocksNode in this process, and a function that spins it until a condition holds."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init(args=[], domain_id=domain)
    node = NanorocksNode('own')
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin_until(condition):
        end = time.monotonic() + _PATIENCE_S
        while not condition() and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.1)
        assert condition()

    yield node, spin_until
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown()


_FAULTS = pytest.StashKey()


@pytest.fixture
def fault_table(request):
    """Adds a row to the table of faults that is printed at the end."""
    rows = request.config.stash.setdefault(_FAULTS, [])

    def add(fault, outcome, seconds=None):
        after = '' if seconds is None else f'{seconds:.1f}'
        rows.append(f'| {fault} | {outcome} | {after} |')

    return add


def pytest_terminal_summary(terminalreporter, config):
    rows = config.stash.get(_FAULTS, [])
    if rows:
        terminalreporter.write_line('| fault | what happens | after [s] |')
        terminalreporter.write_line('| --- | --- | --- |')
        for row in rows:
            terminalreporter.write_line(row)
