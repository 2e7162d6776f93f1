"""A real Dask cluster on the loopback interface."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

import pytest

_PATIENCE = 60.0


class Cluster:
    """A scheduler and its workers, each a process of its own."""

    def __init__(self, folder):
        self._folder = folder
        file = folder / 'scheduler.json'
        self.scheduler = self._start(
            'scheduler', '--port', '0', '--scheduler-file', str(file), '--no-show'
        )
        end = time.monotonic() + _PATIENCE
        while not (file.exists() and file.read_text().endswith('}')):
            assert self.scheduler.poll() is None
            assert time.monotonic() < end
            time.sleep(0.05)
        self.address = json.loads(file.read_text())['address']
        self.workers = []

    def _start(self, kind, *arguments, **environment):
        command = [sys.executable, '-m', f'distributed.cli.dask_{kind}', *arguments]
        with (self._folder / f'{kind}.log').open('a') as log:
            return subprocess.Popen(
                [*command, '--host', '127.0.0.1', '--no-dashboard'],
                stdout=log,
                stderr=log,
                cwd=self._folder,
                env={
                    **os.environ,
                    'OPENBLAS_NUM_THREADS': '1',
                    'DASK_TEMPORARY_DIRECTORY': str(self._folder),
                    **environment,
                },
            )

    def add_worker(self, *arguments, **environment):
        """Without a nanny, unless asked for, so that a killed worker stays dead."""
        arguments = arguments or ('--no-nanny',)
        self.workers.append(
            self._start('worker', self.address, '--nthreads', '1', *arguments, **environment)
        )

    def await_workers(self):
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(len(self.workers), timeout=_PATIENCE)

    def stop(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def scheduler(tmp_path):
    """A cluster without workers."""
    cluster = Cluster(tmp_path)
    try:
        yield cluster
    finally:
        cluster.stop()


@pytest.fixture
def cluster(scheduler):
    """A cluster of two workers."""
    scheduler.add_worker()
    scheduler.add_worker()
    scheduler.await_workers()
    return scheduler
