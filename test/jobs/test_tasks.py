"""Tasks in processes of this machine and on a Dask cluster, some of which are killed."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import time

import pytest

from nanorocks_ros.errors import ConfigurationError, NanorocksError
from nanorocks_ros.jobs import dask_cluster as cluster_module
from nanorocks_ros.jobs.tasks import Workers, as_completed, as_completed_isolated, run_tasks

# Prints the number of the worker that runs it.
ECHO_PID = 'sleep 0.05; echo $PPID'
NUMBERS = {f'number {k}': float(k) for k in range(12)}
ROOTS = [math.sqrt(number) for number in NUMBERS.values()]


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize('processes', [1, 2, None])
def test_results_come_in_the_order_of_the_tasks(processes):
    reported = []
    workers = Workers(processes=processes)
    results = run_tasks(math.sqrt, NUMBERS, workers, lambda *numbers: reported.append(numbers))
    assert results == ROOTS
    assert reported == [(k, 12) for k in range(1, 13)]


def test_no_tasks_are_no_work():
    assert run_tasks(math.sqrt, {}, Workers()) == []


@pytest.mark.parametrize('processes', [1, 2])
def test_what_a_task_raises_is_raised(processes):
    with pytest.raises(ValueError, match='math domain error'):
        run_tasks(math.sqrt, {'good': 1.0, 'bad': -1.0}, Workers(processes=processes))


def test_what_a_killed_worker_had_in_hand_is_done_by_another():
    killed = None
    pids = {}
    tasks = {f'{k}': ECHO_PID for k in range(8)}
    for key, pid in as_completed(subprocess.getoutput, tasks, Workers(processes=2)):
        pids[key] = int(pid)
        if killed is None:
            killed = int(pid)
            os.kill(killed, signal.SIGKILL)
    assert set(pids) == set(tasks)
    assert len(set(pids.values()) - {killed}) >= 1


def test_a_task_that_kills_every_worker_is_given_up():
    with pytest.raises(NanorocksError, match=r'workers: were killed 3 times .*--workers'):
        run_tasks(os._exit, {'a': 3, 'b': 3}, Workers(processes=2))


def test_a_worker_that_dies_costs_what_it_had_in_hand_and_nothing_else():
    # So many that the worker of task 2 has another one to do.
    tasks = {'deadly': 'kill -9 $PPID', **{f'{k}': ECHO_PID for k in range(30)}}
    outputs, killed = {}, []
    results = as_completed_isolated(
        subprocess.getoutput, tasks, Workers(processes=2), lambda key, reason: (key, reason)
    )
    for key, result in results:
        outputs[key] = result
        if key == '2':
            # With nothing in hand, or with the next.
            killed.append(int(result))
            os.kill(killed[0], signal.SIGKILL)
    assert set(outputs) == set(tasks)
    name, reason = outputs.pop('deadly')
    assert name == 'deadly'
    assert 'was killed' in reason
    lost = [output for output in outputs.values() if not isinstance(output, str)]
    assert len(lost) <= 1
    assert multiprocessing.active_children() == []


def test_workers_compute_with_one_thread_of_blas(monkeypatch):
    monkeypatch.delenv('OPENBLAS_NUM_THREADS', raising=False)
    tasks = {'a': 'OPENBLAS_NUM_THREADS', 'b': 'OPENBLAS_NUM_THREADS'}
    assert run_tasks(os.getenv, tasks, Workers(processes=2)) == ['1', '1']
    assert 'OPENBLAS_NUM_THREADS' not in os.environ


def test_work_that_is_not_wanted_any_more_is_stopped():
    results = as_completed(time.sleep, {'short': 0.0, 'endless': 1e6}, Workers(processes=2))
    assert next(results) == ('short', None)
    results.close()
    assert multiprocessing.active_children() == []


def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    script = tmp_path / 'parent.py'
    script.write_text(
        'import subprocess\n'
        'from nanorocks_ros.jobs.tasks import Workers, as_completed\n'
        'if __name__ == "__main__":\n'
        '    tasks = {str(k): "sleep 0.05; echo $PPID" for k in range(10_000)}\n'
        '    for _, pid in as_completed(subprocess.getoutput, tasks, Workers(processes=2)):\n'
        '        print(pid, flush=True)\n'
    )
    parent = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    pids = {int(parent.stdout.readline()) for _ in range(6)}
    parent.kill()
    parent.communicate()
    end = time.monotonic() + 60.0
    while any(alive(pid) for pid in pids):
        assert time.monotonic() < end, 'workers stay'
        time.sleep(0.05)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'processes': 0}, '--workers: 0; give 1 or more'),
        ({'processes': 2, 'scheduler': 'tcp://127.0.0.1:8786'}, 'leave it out'),
        ({'task_seconds': math.nan}, '--task-seconds: nan'),
        ({'task_seconds': 0.0}, '--task-seconds: 0'),
    ],
)
def test_workers_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(ConfigurationError, match=message):
        Workers(**arguments)


def test_a_cluster_gives_and_raises_the_same_until_its_scheduler_is_lost(cluster):
    workers = Workers(scheduler=cluster.address)
    assert run_tasks(math.sqrt, NUMBERS, workers) == ROOTS
    with pytest.raises(ValueError, match='math domain error'):
        run_tasks(math.sqrt, {'good': 1.0, 'bad': -1.0}, workers)
    results = as_completed(time.sleep, {f'{k}': 0.05 for k in range(400)}, workers)
    next(results)
    cluster.scheduler.kill()
    with pytest.raises(NanorocksError, match=r'tcp://.*the scheduler was lost; start it'):
        list(results)


def test_a_task_that_kills_every_worker_of_a_cluster_is_given_up(request, monkeypatch):
    monkeypatch.setenv('DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES', '0')
    monkeypatch.setattr(cluster_module, '_MAX_SUBMISSIONS', 2)
    scheduler = request.getfixturevalue('scheduler')
    # Its nanny starts it anew.
    scheduler.add_worker('--nanny')
    scheduler.await_workers()
    with pytest.raises(NanorocksError, match=r'task deadly: every worker that tried it died, 2 '):
        run_tasks(os._exit, {'deadly': 3}, Workers(scheduler=scheduler.address))


def test_workers_of_another_version_are_refused(scheduler, tmp_path):
    other_package = tmp_path / 'other' / 'nanorocks_ros'
    other_package.mkdir(parents=True)
    (other_package / '__init__.py').write_text('__version__ = "0.0.0"\n')
    scheduler.add_worker('--no-nanny', PYTHONPATH=str(other_package.parent))
    scheduler.await_workers()
    with pytest.raises(NanorocksError, match=r'is 0\.0\.0 on 1 of 1 workers .* same version'):
        run_tasks(math.sqrt, NUMBERS, Workers(scheduler=scheduler.address))


def test_a_cluster_without_workers_is_told_before_and_during_the_work(scheduler, monkeypatch):
    for name in ('_CHECK_INTERVAL', '_NEW_WORKER_TIMEOUT'):
        monkeypatch.setattr(cluster_module, name, 1.0)
    # In it a busy machine has to connect, too.
    monkeypatch.setattr(cluster_module, '_CONNECT_TIMEOUT', 8.0)
    workers = Workers(scheduler=scheduler.address)
    with pytest.raises(NanorocksError, match=r'no workers for 8 s; .* dask worker tcp://'):
        workers.check()
    scheduler.add_worker()
    scheduler.await_workers()
    results = as_completed(time.sleep, {f'{k}': 0.05 for k in range(400)}, workers)
    next(results)
    scheduler.workers[0].kill()
    with pytest.raises(NanorocksError, match=r'no workers for 1 s; .* dask worker tcp://'):
        list(results)


def test_a_scheduler_that_does_not_answer_is_told(monkeypatch):
    monkeypatch.setattr(cluster_module, '_CONNECT_TIMEOUT', 1.0)
    # Bound, but nobody listens; and somebody who listens, but says nothing.
    with socket.socket() as deaf, socket.create_server(('127.0.0.1', 0)) as mute:
        deaf.bind(('127.0.0.1', 0))
        for server in (deaf, mute):
            address = f'tcp://127.0.0.1:{server.getsockname()[1]}'
            with pytest.raises(NanorocksError, match=f'{address}: no Dask scheduler answers'):
                Workers(scheduler=address).check()


@pytest.mark.parametrize(
    'address', ['', 'foo', 'tcp://foo', 'tcp://127.0.0.1:x', 'tcp://127.0.0.1:99999', 'http://a:1']
)
def test_an_address_that_is_none_is_refused(address):
    with pytest.raises(ConfigurationError, match=r'is no address; give tcp://host:port'):
        Workers(scheduler=address).check()


def test_without_dask_the_command_that_installs_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with pytest.raises(ConfigurationError, match=r"pip install 'nanorocks_ros\[cluster\]'"):
        Workers(scheduler='tcp://127.0.0.1:8786').check()
