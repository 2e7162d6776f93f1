"""The golden check: every number that the commands give, against a committed reference.

Runs the public commands alone, and reads what they write by its public format. So it holds while
modules move and are renamed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.golden_columns import read_outputs, summarise
from benchmarks.golden_differences import compare_outputs, compare_summaries
from benchmarks.golden_reference import REFERENCE, read_reference, write_reference

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.golden_columns import Summary
    from benchmarks.golden_reference import Summaries

ROOT = Path(__file__).resolve().parent.parent
EXIT_DIFFERENT, EXIT_CALL, EXIT_INTERRUPTED = 1, 2, 130

_SAMPLE = ROOT / 'bags' / 'tray_1_sample'
_ANALYSE_SAMPLE = f'analyse {_SAMPLE} --json -o results'
_SIMULATE = 'simulate --json --runs 2 --times 11 --trajectory beads.npz --events events.npz'
_PLATE = '--trays 1 2 3 4 5 6 7 8 --preprocess-layout plate --preprocess-pixels-per-metre 12500'
# Of each case its commands, run in a folder of its own. 10 s after the shaking event the swinging
# plate is still faster than the default ratio allows; with 1 all trays give restitutions.
CASES = {
    'sample': (_ANALYSE_SAMPLE,),
    'sample_structure': (f'{_ANALYSE_SAMPLE} --speed-method structure_function',),
    'sample_area': (f'{_ANALYSE_SAMPLE} --speed-method binarised_area --cooling-relation paper',),
    'film': (
        'simulate --scene --seed 7 --duration 10 --effects all --bag film --json',
        f'analyse film --json -o results {_PLATE} --cooling-max-tray-to-bead-speed 1',
    ),
    'tray_1': (f'{_SIMULATE} --tray 1 --duration 10',),
    'tray_3': (f'{_SIMULATE} --tray 3 --duration 5 --tangential-restitution 0.4 --friction 0.3',),
    'tray_6': (f'{_SIMULATE} --tray 6 --duration 5 --sticking-speed 0.001',),
    'sweep': (
        'sweep --json --runs 4 --times 0:5:6 --restitution 0.8,0.9 --wall-restitution 0.9,0.99 '
        '-o sweep.npz --csv sweep.csv',
    ),
}
# In a folder that this check made, and may empty.
_MARK = '.nanorocks_golden'


class GoldenError(Exception):
    """The check cannot be made; the sentence says why."""


def main(arguments: Sequence[str]) -> int:
    """Run the cases, compare or renew; the exit code.

    Returns
    -------
    int
        0: no difference, or the reference was written; 1: differences; 2: the check could not
        be made; 130: interrupted.
    """
    options = _parser().parse_args(arguments)
    try:
        return _check(options)
    except GoldenError as error:
        print(f'golden: {error}', file=sys.stderr)
        return EXIT_CALL
    except KeyboardInterrupt:
        print('\ngolden: interrupted', file=sys.stderr)
        return EXIT_INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks golden', description=__doc__.splitlines()[0]
    )
    parser.add_argument(
        '--only', nargs='+', choices=CASES, metavar='CASE', help=f'of {", ".join(CASES)}'
    )
    parser.add_argument(
        '--tolerance',
        type=float,
        default=0.0,
        metavar='R',
        help='accept other digests where mean, min and max differ by at most R times the '
        'largest magnitude of the column, and as many rows are not known; default 0: bit by bit',
    )
    parser.add_argument('--renew', action='store_true', help='write the reference')
    parser.add_argument(
        '--keep', type=Path, metavar='FOLDER', help='keep the outputs; kept cases are replaced'
    )
    parser.add_argument(
        '--against', type=Path, metavar='FOLDER', help='compare number by number with kept outputs'
    )
    parser.add_argument(
        '--no-run', action='store_true', help='take the outputs in --keep as they are'
    )
    return parser


def _check(options: argparse.Namespace) -> int:
    cases = options.only or list(CASES)
    if options.no_run and not options.keep:
        raise GoldenError('--no-run: needs the outputs; add --keep FOLDER')
    with tempfile.TemporaryDirectory(prefix='golden_') as scratch:
        folder = options.keep or Path(scratch)
        if not options.no_run:
            for case in cases:
                _run_case(case, _emptied(folder / case))
        if options.against:
            return _report_against(folder, options.against, cases)
        summaries = {case: _case_summaries(folder / case) for case in cases}
    if options.renew:
        _renew(summaries)
        return 0
    return _report(summaries, options.tolerance)


def _emptied(folder: Path) -> Path:
    """The folder of a case, empty; only one that this check made is emptied."""
    if folder.exists():
        if not (folder / _MARK).exists():
            raise GoldenError(f'{folder}: is not of this check; name another folder')
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    (folder / _MARK).touch()
    return folder


def _run_case(case: str, folder: Path) -> None:
    for command in CASES[case]:
        verb = command.split()[0]
        print(f'golden: {case}: nanorocks {verb} ...', end='', file=sys.stderr, flush=True)
        start = time.monotonic()
        printed = _run_command(command.split(), folder)
        (folder / f'{verb}.json').write_text(printed, encoding='utf-8')
        print(f' {time.monotonic() - start:.1f} s', file=sys.stderr, flush=True)


def _run_command(command: list[str], folder: Path) -> str:
    """What ``nanorocks`` prints; the package is that of this source tree."""
    script = Path(sys.executable).with_name('nanorocks')
    program = str(script) if script.exists() else shutil.which('nanorocks')
    if program is None:
        raise GoldenError('nanorocks: is not installed; run `make venv`')
    paths = (str(ROOT), os.environ.get('PYTHONPATH'))
    environment = {
        **os.environ,
        'PYTHONPATH': os.pathsep.join(filter(None, paths)),
        'OPENBLAS_NUM_THREADS': '1',
    }
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [program, *command], cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True
    ) as process:
        try:
            printed, messages = process.communicate()
        except BaseException:
            process.send_signal(signal.SIGINT)
            process.wait()
            raise
    if process.returncode:
        raise GoldenError(
            f'nanorocks {" ".join(command)}: exit code {process.returncode}\n{messages.strip()}'
        )
    return printed


def _case_summaries(folder: Path) -> dict[str, dict[str, Summary]]:
    if not folder.is_dir():
        raise GoldenError(f'{folder}: does not exist; run without --no-run')
    return {
        file: {name: summarise(column) for name, column in columns.items()}
        for file, columns in read_outputs(folder).items()
    }


def _renew(summaries: Summaries) -> None:
    """Replace these cases in the reference."""
    known = {**read_reference(), **summaries}
    write_reference({case: known[case] for case in CASES if case in known})
    print(f'golden: {REFERENCE}: {", ".join(summaries)} written')


def _report(summaries: Summaries, tolerance: float) -> int:
    reference = read_reference()
    unknown = [case for case in summaries if case not in reference]
    if unknown:
        raise GoldenError(f'{REFERENCE}: no {", ".join(unknown)}; write it with --renew')
    comparison = compare_summaries(
        {case: reference[case] for case in summaries}, summaries, tolerance
    )
    if comparison.differences:
        print(comparison.table())
        return EXIT_DIFFERENT
    accepted = comparison.accepted
    exact = f'{comparison.columns - accepted} of {comparison.columns} columns are bit-identical'
    within = f'; {accepted} differ by at most {tolerance:g}' if accepted else ''
    print(f'golden: {", ".join(summaries)}: {exact}{within}')
    return 0


def _report_against(folder: Path, other: Path, cases: list[str]) -> int:
    for case in cases:
        for outputs in (folder / case, other / case):
            if not outputs.is_dir():
                raise GoldenError(f'{outputs}: does not exist; run with --keep first')
    comparison = compare_outputs(
        {case: read_outputs(other / case) for case in cases},
        {case: read_outputs(folder / case) for case in cases},
    )
    if comparison.differences:
        print(comparison.table())
        return EXIT_DIFFERENT
    print(f'golden: {", ".join(cases)}: {comparison.columns} columns are bit-identical')
    return 0
