"""Processor time of the first analysis after an installation, and of the second.

With and without `nanorocks compile` at the installation.
"""

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
_COMPILE = """
import sys
from nanorocks_ros.cli.main import main
if __name__ == '__main__':
    sys.exit(main(['compile']))
"""
_COUNT = """
from numba.core import event
class Counter(event.Listener):
    count = 0
    def on_start(self, event):
        self.count += 1
    def on_end(self, event):
        pass
counter = Counter()
event.register('numba:compile', counter)
from nanorocks_ros.cli.main import main
main(['analyse', 'bags/tray_1_sample', '--no-output'])
assert counter.count == 0, f'{counter.count} functions were compiled'
"""
_IMPORT = 'import nanorocks_ros.studies.analysis.offline_analysis'
_BY_NUMBA, _LEAN = _ANALYSE.format(by_numba=True), _ANALYSE.format(by_numba=False)
_FIRST, _FIRST_BY_NUMBA = 'first, nothing compiled before', 'first, compiled by numba alone'
# Rows of the report: name, what is run, folder, goal [s].
_STARTS = (
    (_FIRST_BY_NUMBA, _BY_NUMBA, 'numba', None),
    (_FIRST, _LEAN, 'lean', None),
    ('second', _LEAN, 'lean', 3.0),
    ('`nanorocks compile`, at the installation', _COMPILE, 'compiled', None),
    ('first after it', _LEAN, 'compiled', 20.0),
    ('second after it', _LEAN, 'compiled', 3.0),
    ('`nanorocks compile` again', _COMPILE, 'compiled', None),
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
        for start, code, kept, goal in _STARTS:
            spent[start], wall = _seconds(code, folder, folder / kept)
            size = sum(path.stat().st_size for path in (folder / kept).rglob('*.nb?')) / 1e6
            limit = f'{goal:.0f}' if goal else ''
            print(f'| {start} | {spent[start]:.1f} | {wall:.1f} | {limit} | {size:.1f} |')
        _seconds(_COUNT, folder, folder / 'compiled')
    share = spent[_FIRST] / spent[_FIRST_BY_NUMBA]
    print(f'\nWithout the command the first start takes {share:.2f} of the time with numba alone.')
    print('After it no function is compiled.')


def _seconds(code: str, folder: Path, kept: Path) -> tuple[float, float]:
    """Processor and wall time of a process that keeps compiled code in a folder."""
    variables = {name: text for name, text in os.environ.items() if name != _NO_BYTECODE}
    variables['NUMBA_CACHE_DIR'] = str(kept)
    variables['PYTHONPYCACHEPREFIX'] = str(folder / 'bytecode')
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    # Worker processes import what is run.
    script = folder / 'start.py'
    script.write_text(code)
    variables['PYTHONPATH'] = str(ROOT)
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, str(script)], cwd=ROOT, env=variables, check=True, capture_output=True
    )
    wall = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


_NO_BYTECODE = 'PYTHONDONTWRITEBYTECODE'
