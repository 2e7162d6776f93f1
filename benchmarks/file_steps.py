"""Kill a job at a numbered step of its work on files: the same instant in every run.

A step is one call that opens a file for writing, or makes, renames or deletes a file or folder,
below one folder. Python tells each before it happens. The job runs in a child of this process,
which kills itself with SIGKILL before the step.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import signal
import sys
import traceback
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

_CHANGES = ('os.mkdir', 'os.rename', 'os.remove', 'os.rmdir', 'os.link', 'os.symlink')
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
_KILLED = -signal.SIGKILL
_FAILED, _FINISHED = 1, 0
# When it was made: the only thing in which two results may differ.
_DATE = re.compile(rb'\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?')


def run_until(
    job: Callable[[], object], folder: Path, step: int | str = 0
) -> tuple[int, list[str]]:
    """Run a job in a child process, and kill it before a step.

    Parameters
    ----------
    job : callable
    folder : Path
        Steps below it count.
    step : int or str
        Its number, from 1, or a pattern of its text; 0: to the end.

    Returns
    -------
    int, list of str
        Exit code, -9 where it was killed, and the steps that were begun.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        _run(job, folder, step, writer)
    os.close(writer)
    with os.fdopen(reader, encoding='utf-8', errors='replace') as stream:
        steps = stream.read().splitlines()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), steps


def _run(job: Callable[[], object], folder: Path, step: int | str, writer: int) -> None:
    """The child: run the job and exit."""
    count = 0
    start = os.fspath(folder)

    def watch(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal count
        path = _changed_file(event, arguments, start)
        if path:
            count += 1
            os.write(writer, f'{event} {path}\n'.encode(errors='replace'))
            if count == step or (isinstance(step, str) and re.search(step, f'{event} {path}')):
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(watch)
    try:
        job()
    except BaseException:
        traceback.print_exc()
        os._exit(_FAILED)
    os._exit(_FINISHED)


def _changed_file(event: str, arguments: tuple[object, ...], start: str) -> str:
    """The path of a step below the folder; an empty text for anything else."""
    if event == 'open':
        flags = arguments[2]
        if not (isinstance(flags, int) and flags & _WRITES):
            return ''
    elif event not in _CHANGES:
        return ''
    paths = [os.fspath(path) for path in arguments[:2] if isinstance(path, str | os.PathLike)]
    # Where a tree is deleted, the path is told relative to a descriptor.
    in_tree = event in ('os.remove', 'os.rmdir') and not os.path.isabs(str(paths[0]))
    return next((str(path) for path in paths if in_tree or str(path).startswith(start)), '')


def was_killed(code: int) -> bool:
    """Whether this exit code is that of a job that was killed before a step."""
    return code == _KILLED


def digests(folder: Path) -> dict[str, str]:
    """A digest of each file below a folder, hidden ones too, without the date in it."""
    return {
        str(path.relative_to(folder)): _digest(path)
        for path in sorted(folder.rglob('*'))
        if not path.is_symlink()
    }


def _digest(path: Path) -> str:
    if path.is_dir():
        return 'folder'
    content = path.read_bytes()
    if path.suffix in ('.json', '.html'):
        content = _DATE.sub(b'', content)
    return hashlib.sha256(content).hexdigest()


def difference(actual: dict[str, str], wanted: dict[str, str]) -> list[str]:
    """The files that differ, one line each."""
    lines = []
    for name in sorted({*actual, *wanted}):
        if name not in actual:
            lines.append(f'{name} is missing')
        elif name not in wanted:
            lines.append(f'{name} is left over')
        elif actual[name] != wanted[name]:
            lines.append(f'{name} has another content')
    return lines


def kill_at_each_step(
    job: Callable[[], object], folder: Path, before: Path | None = None
) -> tuple[int, list[str]]:
    """Kill a job before each of its steps, run it again, and compare with a run without a kill.

    Parameters
    ----------
    job : callable
    folder : Path
        Where it writes; emptied before each kill.
    before : Path, optional
        A folder of what lies there when the job begins; by default nothing.

    Returns
    -------
    int, list of str
        The number of kills, and what differed after the second run, one line each.
    """

    def prepare() -> None:
        shutil.rmtree(folder)
        folder.mkdir() if before is None else shutil.copytree(before, folder)

    prepare()
    code, steps = run_until(job, folder)
    wanted, lines = digests(folder), []
    if code:
        lines.append(f'without a kill: exit code {code}')
    for step, path in enumerate(steps, 1):
        prepare()
        killed, _ = run_until(job, folder, step)
        code, _ = run_until(job, folder)
        differing = difference(digests(folder), wanted)
        if not was_killed(killed) or code or differing:
            lines.append(f'{step} {path}: exit codes {killed}, {code}; {"; ".join(differing)}')
    return len(steps), lines
