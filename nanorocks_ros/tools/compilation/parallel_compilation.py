"""Compiles, in several processes, all functions that commands and nodes use, before they do.

Which these are stands in `compiled_functions.txt`, see `function_list`. Processes that compile at
a time write into one folder of kernels, see `numerics.compilation.compile_lock`.
"""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import nanorocks_ros
from nanorocks_ros.jobs.worker_processes import run_in_processes
from nanorocks_ros.numerics.compilation.compiled_versions import CompiledVersion
from nanorocks_ros.numerics.compilation.kernel_cache import cache_root

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

LIST = 'compiled_functions.txt'


def listed_versions() -> tuple[CompiledVersion, ...]:
    """The versions that commands and nodes use; those that take longest to compile first."""
    text = resources.files(__package__).joinpath(LIST).read_text(encoding='utf-8')
    return tuple(CompiledVersion.parse(line) for line in text.splitlines())


def kernels_folder() -> Path:
    """Where compiled functions are kept: beside the source where no folder of them can be made."""
    root = cache_root()
    return root if root.is_dir() else Path(nanorocks_ros.__file__).parent


def missing_versions(versions: Iterable[CompiledVersion]) -> tuple[CompiledVersion, ...]:
    """Those that are not kept on disk, or whose function does not exist."""
    return tuple(version for version in versions if not _is_kept(version))


def _is_kept(version: CompiledVersion) -> bool:
    try:
        return version.is_kept()
    except LookupError:
        return False


class _Spent(NamedTuple):
    """What a worker says of the versions of one function: processor time, and what went wrong."""

    seconds: float
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Compilation:
    """What was compiled.

    Attributes
    ----------
    functions : int
        Versions of functions.
    seconds, processor_seconds : float, [s]
    faults : tuple of str
        A line for each version that could not be compiled, or not be kept.
    """

    functions: int
    seconds: float
    processor_seconds: float
    faults: tuple[str, ...]


def compile_versions(
    versions: Sequence[CompiledVersion],
    processes: int,
    progress: Callable[[int, int], object],
) -> Compilation:
    """Compile versions of functions, and keep them on disk.

    Parameters
    ----------
    versions : sequence of CompiledVersion
        They are begun in this order; the versions of a function together.
    processes : int, > 0
    progress : callable
        Called with the number of versions that are done, and of all.

    Raises
    ------
    NanorocksError
        Where the processes are killed again and again.
    """
    start = time.perf_counter()
    tasks: dict[str, tuple[str, ...]] = {}
    for version in versions:
        name = f'{version.module}.{version.function}'
        tasks[name] = (*tasks.get(name, ()), str(version))
    done, spent = 0, 0.0
    faults: list[str] = []
    with closing(run_in_processes(_compile_all, tasks, min(processes, len(tasks)))) as results:
        for name, result in results:
            done += len(tasks[name])
            spent += result.seconds
            faults += result.faults
            progress(done, len(versions))
    return Compilation(
        functions=done - len(faults),
        seconds=time.perf_counter() - start,
        processor_seconds=spent,
        faults=tuple(faults),
    )


def _compile_all(lines: Sequence[str]) -> _Spent:
    """Compile the versions of a function, in a worker process."""
    start, faults = time.process_time(), []
    for line in lines:
        version = CompiledVersion.parse(line)
        try:
            version.compile()
        # numba and LLVM raise errors of many types; the function is compiled when it is called.
        except Exception as error:
            reason = str(error).strip().partition('\n')[0]
            faults.append(f'{version.module}.{version.function}: {reason or type(error).__name__}')
            continue
        if not version.is_kept():
            faults.append(f'{version.module}.{version.function}: cannot be kept on disk')
    return _Spent(time.process_time() - start, tuple(faults))
