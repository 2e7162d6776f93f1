"""``nanorocks compile``: compile all functions now, not when they are first used."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.jobs.interruption import interruption_says

if TYPE_CHECKING:
    import argparse

_EXIT_FAULTS = 1


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

    def kept() -> str:
        left = len(missing_versions(missing))
        return (
            f'{len(listed) - left} of {len(listed)} functions are compiled and stay in '
            f'{kernels_folder()}; the same command compiles the others'
        )

    made = Compilation(functions=0, seconds=0.0, processor_seconds=0.0, faults=())
    if missing:
        with interruption_says(kept), Progress('compiling functions') as progress:
            made = compile_versions(missing, processes, progress.count)
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
