"""``nanorocks compile``: compile all functions now, not when they are first used."""

from __future__ import annotations

import json
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator

_EXIT_FAULTS = 1
# Without a terminal a line says this often how far it is, [s].
_REPEAT_S = 10.0


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'compile',
        help='compile all functions now, on all cores, so that no command or node does so later',
        description='Compile all functions that commands and nodes use, so that none of them '
        'waits for it at its first start. After Ctrl-C, or an update, the same command compiles '
        'what is missing.',
    )
    parser.add_argument('--workers', type=int, help='processes; default: one for each core')
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Compile what is missing and say what was done; 1 where a function could not be, else 0."""
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.tools.compilation.parallel_compilation import (
        Compilation,
        compile_versions,
        kernels_folder,
        listed_versions,
        missing_versions,
    )

    processes = Workers(processes=options.workers).count
    listed = listed_versions()
    missing = missing_versions(listed)
    made = Compilation(functions=0, seconds=0.0, processor_seconds=0.0, faults=())
    if missing:
        with _progress(len(missing)) as progress:
            try:
                made = compile_versions(missing, processes, progress)
            except KeyboardInterrupt:
                left = len(missing_versions(missing))
                raise KeyboardInterrupt(
                    f'{len(listed) - left} of {len(listed)} functions are compiled and stay in '
                    f'{kernels_folder()}; the same command compiles the others'
                ) from None
    if options.json:
        summary = {
            'functions': len(listed),
            'compiled': made.functions,
            'seconds': made.seconds,
            'processor_seconds': made.processor_seconds,
            'faults': made.faults,
            'folder': str(kernels_folder()),
        }
        print(json.dumps(summary))
    elif missing:
        print(
            f'{made.functions} of {len(listed)} functions compiled in {made.seconds:.0f} s by '
            f'{processes} processes ({made.processor_seconds:.0f} s of processor time)'
        )
        print(f'kept in {kernels_folder()}')
    else:
        print(f'all {len(listed)} functions are compiled already, in {kernels_folder()}')
    for fault in made.faults:
        tell(f'{fault}; it is compiled when it is first used')
    return _EXIT_FAULTS if made.faults else 0


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int, str], None]]:
    """Show how many functions are compiled, and the last: one line on a terminal, else a few."""
    told_at = time.monotonic()
    terminal = sys.stderr.isatty()

    def show(done: int, name: str) -> None:
        nonlocal told_at
        line = f'{done} of {total} functions compiled, last {name}'
        if terminal:
            print(f'\r\x1b[Knanorocks: {line}', end='', file=sys.stderr, flush=True)
        elif time.monotonic() - told_at > _REPEAT_S:
            told_at = time.monotonic()
            tell(line)

    if terminal:
        show(0, 'none')
    try:
        yield show
    finally:
        if terminal:
            print('\r\x1b[K', end='', file=sys.stderr, flush=True)
