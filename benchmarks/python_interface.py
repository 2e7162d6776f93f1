"""The Python interface: CPU of the import, and lines and minutes from a film to the COR."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import nanorocks_ros as nr

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOK = ROOT / 'docs/notebooks/own_film.ipynb'
SECTION = '## Five lines'
REPEATS = 20
FILM = {'tray': 1, 'duration': 15, 'restitution': 0.89, 'wall_restitution': 0.99}


def cpu_of(code, folder=ROOT):
    """CPU and elapsed time of a Python process of its own, [s], and what it prints."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    command = [sys.executable, '-c', code]
    run = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    elapsed = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, elapsed, run.stdout


def import_cpu():
    """CPU of the import beyond that of an empty program, [s]: the least of many."""
    empty, whole = (
        min(cpu_of(code)[0] for _ in range(REPEATS)) for code in ('pass', 'import nanorocks_ros')
    )
    return whole - empty


def five_lines():
    """The lines of the notebook that take a film to its contacts and the COR."""
    cells = json.loads(NOTEBOOK.read_text('utf-8'))['cells']
    sources = [''.join(cell['source']) for cell in cells]
    start = next(k for k, source in enumerate(sources) if SECTION in source)
    lines = [line for source in sources[start + 1 : start + 5] for line in source.splitlines()]
    # A name alone shows the summary.
    return [line for line in lines if line and line != 'film']


def report():
    """Print the figures."""
    print(f'`import nanorocks_ros`: {1e3 * import_cpu():.0f} ms of CPU beside an empty program')
    lines = five_lines()
    print(f'from a film to its contacts and the COR: {len(lines)} lines')
    with tempfile.TemporaryDirectory() as folder:
        film = nr.simulate(film=Path(folder) / 'film.avi', progress=False, **FILM)
        code = '\n'.join([*lines, 'print(film.cor.iloc[0].to_json())'])
        cpu, elapsed, told = cpu_of(code, folder)
        cor = json.loads(told)
        frames = round((FILM['duration'] + 1.0) * 30)
        interval = f'[{cor["restitution_lower"]:.3f}, {cor["restitution_upper"]:.3f}]'
        print(
            f'these lines, about {frames} frames: {elapsed / 60:.2f} min, {cpu:.1f} s of CPU; COR '
            f'{cor["restitution"]:.3f} {interval}, truth {film.cor["restitution"].item():g}'
        )
