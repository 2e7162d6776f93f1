"""Tasks on the workers of a running Dask cluster.

Tested by ``test/jobs/test_tasks.py``.
"""

from __future__ import annotations

import asyncio
import logging
import pkgutil
from collections import Counter
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, TypeVar
from uuid import uuid4

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError, NanorocksError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Mapping

Argument = TypeVar('Argument')
Result = TypeVar('Result')

# Timeout for the answer of a scheduler, and for the first worker [s].
_CONNECT_TIMEOUT = 10.0
# Interval of the check that there are workers, and timeout for new ones [s].
_CHECK_INTERVAL, _NEW_WORKER_TIMEOUT = 30.0, 60.0
# Dask abandons a task that has killed four workers; it is submitted at most this often.
_MAX_SUBMISSIONS = 5
# On Python 3.10 neither is a subclass of the other.
_TIMEOUT_ERRORS = (TimeoutError, asyncio.TimeoutError)
_LOGGERS = ('distributed', 'distributed.client')


def run_on_cluster(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    scheduler: str,
    lost: Callable[[str, str], Result] | None = None,
) -> Generator[tuple[str, Result], None, None]:
    """Yield results as tasks finish; another worker repeats the task of a lost one.

    Parameters
    ----------
    function : callable
    tasks : mapping of str to picklable objects
    scheduler : str
        Address, ``tcp://host:port``.
    lost : callable, optional
        Returns the result of a task that killed its workers, from its key and the reason;
        without it, such a task ends the job.

    Yields
    ------
    key, result

    Raises
    ------
    ConfigurationError
        When Dask is not installed, or the address is not one.
    NanorocksError
        When the scheduler does not answer within 10 s or is lost, when there are no workers,
        or these run another version of this package.
    """
    with _checked_client(scheduler) as client:
        yield from _run_tasks(client, scheduler, function, dict(tasks), lost)


def check_cluster(scheduler: str) -> None:
    """Raise for a cluster that cannot be used, before any work is done.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://host:port``.

    Raises
    ------
    ConfigurationError
        When Dask is not installed, or the address is not one.
    NanorocksError
        When the scheduler does not answer within 10 s, when there are no workers, or these run
        another version of this package.
    """
    with _checked_client(scheduler):
        pass


@contextmanager
def _checked_client(scheduler: str) -> Iterator[Any]:
    with _quiet_logs(), _connected(scheduler) as client:
        _await_workers(client, scheduler, _CONNECT_TIMEOUT)
        _check_versions(client, scheduler)
        yield client


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """Suppress the tracebacks that Dask logs; errors are raised, as one line."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL + 1)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def _connected(scheduler: str) -> Iterator[Any]:
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError as error:
        raise ConfigurationError(
            '--scheduler',
            'needs Dask, which is not installed',
            "run: pip install 'nanorocks_ros[cluster]'",
        ) from error
    try:
        # Checked here: the client retries a wrong address for long.
        _, port = get_address_host_port(scheduler)
        if not 0 < int(port) < 65536:
            raise ValueError(f'port {port}')
    except (ValueError, TypeError) as error:
        raise ConfigurationError(
            '--scheduler', f'{scheduler!r} is no address', 'give tcp://host:port'
        ) from error
    # In a thread, since this one may run an event loop, as in a notebook.
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, _await_scheduler(scheduler)).result()
    try:
        client = Client(scheduler, timeout=_CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, *_TIMEOUT_ERRORS) as error:
        raise _no_answer(scheduler) from error
    try:
        yield client
    finally:
        with suppress(OSError):
            client.close()


async def _await_scheduler(address: str) -> None:
    """Raise for an address that does not answer; Dask itself may wait for ever."""
    from distributed.core import rpc

    try:
        async with rpc(address) as scheduler:
            await asyncio.wait_for(scheduler.identity(), _CONNECT_TIMEOUT)
    except (OSError, *_TIMEOUT_ERRORS) as error:
        raise _no_answer(address) from error


def _no_answer(address: str) -> NanorocksError:
    return NanorocksError(
        address,
        f'no Dask scheduler answers within {_CONNECT_TIMEOUT:g} s',
        'start one with: dask scheduler',
    )


def _await_workers(client: Any, scheduler: str, seconds: float) -> None:
    try:
        client.wait_for_workers(1, timeout=seconds)
    except _TIMEOUT_ERRORS as error:
        raise NanorocksError(
            scheduler,
            f'the scheduler has had no workers for {seconds:g} s',
            f'start some with: dask worker {scheduler}',
        ) from error


def _check_versions(client: Any, scheduler: str) -> None:
    versions = client.run(pkgutil.resolve_name, 'nanorocks_ros:__version__', on_error='return')
    # A worker that has left meanwhile (OSError) has no other version.
    mismatched = {
        worker: version if isinstance(version, str) else f'missing ({version})'
        for worker, version in versions.items()
        if version != __version__ and not isinstance(version, OSError)
    }
    if mismatched:
        worker, version = next(iter(mismatched.items()))
        raise NanorocksError(
            scheduler,
            f'nanorocks_ros is {version} on {len(mismatched)} of {len(versions)} workers '
            f'({worker}), but {__version__} here',
            'install the same version everywhere',
        )


def _run_tasks(
    client: Any,
    scheduler: str,
    function: Callable[[Argument], Result],
    tasks: dict[str, Argument],
    lost: Callable[[str, str], Result] | None,
) -> Generator[tuple[str, Result], None, None]:
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    # Unique keys: the scheduler would share results of equal keys between clients.
    session = uuid4().hex
    names = [f'{key}-{session}' for key in tasks]
    # No reference to a finished future is kept, so that the cluster frees the result.
    futures = client.map(function, list(tasks.values()), key=names, pure=False)
    keys = dict(zip(futures, tasks, strict=True))
    del futures
    submissions: Counter[str] = Counter()
    try:
        for future in _completed_futures(client, scheduler, keys):
            key = keys[future]
            try:
                result = future.result(timeout=_CHECK_INTERVAL)
            except _TIMEOUT_ERRORS:
                if future.status == 'error':
                    raise
                # The only worker with the result is lost: the task is run again.
                _await_workers(client, scheduler, _NEW_WORKER_TIMEOUT)
                continue
            except KilledWorker as error:
                del keys[future]
                if lost is not None:
                    yield key, lost(key, f'{error.allowed_failures + 1} workers died running it')
                    continue
                submissions[key] += 1
                if submissions[key] == _MAX_SUBMISSIONS:
                    raise _task_kills_workers(key, error) from error
                name = f'{key}-{session}-{submissions[key]}'
                keys[client.submit(function, tasks[key], key=name, pure=False)] = key
                continue
            except (CancelledError, CommClosedError) as error:
                raise NanorocksError(
                    scheduler,
                    'the scheduler was lost',
                    'start it again, and then the same command',
                ) from error
            del keys[future]
            yield key, result
    finally:
        with suppress(OSError, CancelledError):
            client.cancel(list(keys))


def _completed_futures(client: Any, scheduler: str, futures: Mapping[Any, str]) -> Iterator[Any]:
    """Yield futures as they finish, while there are workers."""
    from distributed import as_completed

    while futures:
        try:
            yield from as_completed(list(futures), loop=client.loop, timeout=_CHECK_INTERVAL)
        except _TIMEOUT_ERRORS:
            _await_workers(client, scheduler, _NEW_WORKER_TIMEOUT)


def _task_kills_workers(key: str, error: Any) -> NanorocksError:
    workers = _MAX_SUBMISSIONS * (error.allowed_failures + 1)
    return NanorocksError(
        f'task {key}',
        f'every worker that tried it died, {workers} of them',
        'look into the logs of the workers, for lack of memory first',
    )
