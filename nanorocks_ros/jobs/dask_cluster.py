"""Tasks on a Dask cluster that somebody else started: the scheduler hands them to its workers."""

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

# How long a scheduler may take to answer, and a cluster to show its first worker [s].
_PATIENCE = 10.0
# How often we look whether there is still a worker, and how long we wait for a new one [s].
_LOOK, _WORKERS_BACK = 30.0, 60.0
# Dask gives a task up after four workers died over it; we hand it in so often.
_MOST_TRIES = 5
# On Python 3.10 the one is no kind of the other.
_TIMED_OUT = (TimeoutError, asyncio.TimeoutError)
_LOGGERS = ('distributed', 'distributed.client')


def finished_on_cluster(
    function: Callable[[Argument], Result],
    tasks: Mapping[str, Argument],
    scheduler: str,
    lost: Callable[[str, str], Result] | None = None,
) -> Generator[tuple[str, Result], None, None]:
    """Results as they come. What a lost worker had in hand goes to another.

    Parameters
    ----------
    function : callable
    tasks : mapping of str to picklable objects
    scheduler : str
        Address, ``tcp://host:port``.
    lost : callable, optional
        Makes, of a key and what happened, the result of a task over which workers died; without
        it that ends everything.

    Yields
    ------
    key, result

    Raises
    ------
    ConfigurationError
        When Dask is not installed, or the address is none.
    NanorocksError
        When the scheduler does not answer within 10 s or is lost, when there are no workers,
        or these run another version of this package.
    """
    with _checked(scheduler) as client:
        yield from _gathered(client, scheduler, function, dict(tasks), lost)


def check_cluster(scheduler: str) -> None:
    """Refuse a cluster that cannot be used, before any work is done.

    Parameters
    ----------
    scheduler : str
        Address, ``tcp://host:port``.

    Raises
    ------
    ConfigurationError
        When Dask is not installed, or the address is none.
    NanorocksError
        When the scheduler does not answer within 10 s, when there are no workers, or these run
        another version of this package.
    """
    with _checked(scheduler):
        pass


@contextmanager
def _checked(scheduler: str) -> Iterator[Any]:
    with _quiet_logs(), _connected(scheduler) as client:
        _await_workers(client, scheduler, _PATIENCE)
        _check_versions(client, scheduler)
        yield client


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """No tracebacks of Dask's own; what goes wrong is raised, as one line."""
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
        # Before the client, which takes its time to give such an address up.
        _, port = get_address_host_port(scheduler)
        if not 0 < int(port) < 65536:
            raise ValueError(f'port {port}')
    except (ValueError, TypeError) as error:
        raise ConfigurationError(
            '--scheduler', f'{scheduler!r} is no address', 'give tcp://host:port'
        ) from error
    # In a thread, since there may be an event loop in this one, as in a notebook.
    with ThreadPoolExecutor(1) as thread:
        thread.submit(asyncio.run, _await_scheduler(scheduler)).result()
    client = Client(scheduler, timeout=_PATIENCE, set_as_default=False)
    try:
        yield client
    finally:
        with suppress(OSError):
            client.close()


async def _await_scheduler(address: str) -> None:
    """Refuse an address where nobody answers; Dask itself may wait for ever."""
    from distributed.core import rpc

    try:
        async with rpc(address) as scheduler:
            await asyncio.wait_for(scheduler.identity(), _PATIENCE)
    except (OSError, *_TIMED_OUT) as error:
        raise NanorocksError(
            address,
            f'no Dask scheduler answers within {_PATIENCE:g} s',
            'start one with: dask scheduler',
        ) from error


def _await_workers(client: Any, scheduler: str, seconds: float) -> None:
    try:
        client.wait_for_workers(1, timeout=seconds)
    except _TIMED_OUT as error:
        raise NanorocksError(
            scheduler,
            f'the scheduler has had no workers for {seconds:g} s',
            f'start some with: dask worker {scheduler}',
        ) from error


def _check_versions(client: Any, scheduler: str) -> None:
    found = client.run(pkgutil.resolve_name, 'nanorocks_ros:__version__', on_error='return')
    # A worker that went away meanwhile is no worker with another version.
    wrong = {
        worker: version if isinstance(version, str) else f'missing ({version})'
        for worker, version in found.items()
        if version != __version__ and not isinstance(version, OSError)
    }
    if wrong:
        worker, version = next(iter(wrong.items()))
        raise NanorocksError(
            scheduler,
            f'nanorocks_ros is {version} on {len(wrong)} of {len(found)} workers ({worker}), '
            f'but {__version__} here',
            'install the same version everywhere',
        )


def _gathered(
    client: Any,
    scheduler: str,
    function: Callable[[Argument], Result],
    left: dict[str, Argument],
    lost: Callable[[str, str], Result] | None,
) -> Generator[tuple[str, Result], None, None]:
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    # Keys of ours alone: what another client asked for is another question.
    session = uuid4().hex
    names = [f'{key}-{session}' for key in left]
    # No reference to a future stays when it is done, so that the cluster forgets the result.
    futures = client.map(function, list(left.values()), key=names, pure=False)
    keys = dict(zip(futures, left, strict=True))
    del futures
    tries: Counter[str] = Counter()
    try:
        for future in _done(client, scheduler, keys):
            key = keys[future]
            try:
                result = future.result(timeout=_LOOK)
            except _TIMED_OUT:
                if future.status == 'error':
                    raise
                # The only worker that had the result is gone: it will be worked out again.
                _await_workers(client, scheduler, _WORKERS_BACK)
                continue
            except KilledWorker as error:
                del keys[future]
                if lost is not None:
                    yield key, lost(key, f'{error.allowed_failures + 1} workers died over it')
                    continue
                tries[key] += 1
                if tries[key] == _MOST_TRIES:
                    raise _deadly(key, error) from error
                name = f'{key}-{session}-{tries[key]}'
                keys[client.submit(function, left[key], key=name, pure=False)] = key
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


def _done(client: Any, scheduler: str, futures: Mapping[Any, str]) -> Iterator[Any]:
    """Futures as they are done, as long as there are any and workers to do them."""
    from distributed import as_completed

    while futures:
        try:
            yield from as_completed(list(futures), loop=client.loop, timeout=_LOOK)
        except _TIMED_OUT:
            _await_workers(client, scheduler, _WORKERS_BACK)


def _deadly(key: str, error: Any) -> NanorocksError:
    return NanorocksError(
        f'task {key}',
        f'every worker that tried it died, {_MOST_TRIES * (error.allowed_failures + 1)} of them',
        'look into the logs of the workers, for lack of memory first',
    )
