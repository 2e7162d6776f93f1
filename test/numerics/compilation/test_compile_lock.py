"""Processes that need the same function at the same time compile it once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import nanorocks_ros

ROOT = Path(nanorocks_ros.__file__).parents[1]
MODULE = """
from nanorocks_ros.numerics.compiled import compiled

@compiled
def shared(x):
    total = 0.0
    for k in range(100):
        total += (x + k) ** 0.5
    return total
"""
# Processes compile after all of them have started.
ASK = """
import sys
from lone import shared
print('ready', flush=True)
sys.stdin.readline()
shared(2.0)
print(sum(shared.stats.cache_hits.values()))
"""
BROKEN = """
from nanorocks_ros.numerics.compiled import compiled
import numba

@compiled
def refused(x):
    return x + 'text'

for attempt in range(2):
    try:
        refused(1)
    except numba.TypingError:
        print('refused')
"""


def started(folder, code):
    paths = os.pathsep.join((str(folder), str(ROOT)))
    return subprocess.Popen(
        [sys.executable, '-c', code],
        env={**os.environ, 'PYTHONPATH': paths, 'NUMBA_CACHE_DIR': str(folder / 'kept')},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_of_processes_that_start_together_one_compiles_and_the_others_load(tmp_path):
    (tmp_path / 'lone.py').write_text(MODULE)
    processes = [started(tmp_path, ASK) for _ in range(3)]
    assert [process.stdout.readline() for process in processes] == ['ready\n'] * 3
    hits = sorted(process.communicate('go\n', timeout=120)[0] for process in processes)
    assert hits == ['0\n', '1\n', '1\n']


def test_what_cannot_be_compiled_keeps_nobody_waiting(tmp_path):
    (tmp_path / 'broken.py').write_text(BROKEN)
    first = started(tmp_path, 'import broken; print("first", flush=True); input()')
    assert [first.stdout.readline() for _ in range(3)] == ['refused\n', 'refused\n', 'first\n']
    second, _ = started(tmp_path, 'import broken').communicate(timeout=120)
    assert second == 'refused\n' * 2
    first.communicate('\n', timeout=120)
