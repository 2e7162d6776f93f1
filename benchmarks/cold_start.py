"""Processor time of the first analysis after an installation, and of the second."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_ANALYSE = """
import sys
from nanorocks_ros.numerics.compilation import lean_compilation
if {by_numba}:
    lean_compilation.compile_lean = lambda function: None
from nanorocks_ros.cli.main import main
sys.exit(main(['analyse', 'bags/tray_1_sample', '--no-output']))
"""
_IMPORT = 'import nanorocks_ros.studies.analysis.offline_analysis'
# Rows of the report: name, whether numba compiles in its own way, folder, goal [s].
_STARTS = (
    ('first, compiled by numba alone', True, 'numba', None),
    ('first', False, 'lean', 20.0),
    ('second', False, 'lean', 3.0),
)


def report() -> None:
    """Print a table of processor and wall time, and the size of what is kept."""
    print('| start | processor [s] | wall [s] | goal [s] | kept [MB] |')
    print('| --- | --- | --- | --- | --- |')
    spent = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # An installation translates the modules; here that is done before.
        _seconds(_IMPORT, folder, folder / 'warm-up')
        for start, by_numba, kept, goal in _STARTS:
            code = _ANALYSE.format(by_numba=by_numba)
            spent[start], wall = _seconds(code, folder, folder / kept)
            size = sum(path.stat().st_size for path in (folder / kept).rglob('*.nb?')) / 1e6
            limit = f'{goal:.0f}' if goal else ''
            print(f'| {start} | {spent[start]:.1f} | {wall:.1f} | {limit} | {size:.1f} |')
    by_numba, lean = spent[_STARTS[0][0]], spent[_STARTS[1][0]]
    print(f'\nThe first start takes {lean / by_numba:.2f} of the time with numba alone.')


def _seconds(code: str, folder: Path, kept: Path) -> tuple[float, float]:
    """Processor and wall time of a process that keeps compiled code in a folder."""
    variables = {name: text for name, text in os.environ.items() if name != _NO_BYTECODE}
    variables['NUMBA_CACHE_DIR'] = str(kept)
    variables['PYTHONPYCACHEPREFIX'] = str(folder / 'bytecode')
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, '-c', code], cwd=ROOT, env=variables, check=True, capture_output=True
    )
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


_NO_BYTECODE = 'PYTHONDONTWRITEBYTECODE'
