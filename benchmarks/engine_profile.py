"""Instructions and cache misses per collision, counted by valgrind where it is installed.

`python -m benchmarks.engine_profile`; some minutes. What a run of so many more collisions takes
more is what they cost: start-up and lists drop out. Valgrind has its own idea of the processor, so
the loop is compiled for one without vectors, before.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.engine import DENSE, gas_of, mean_free_time

SIZES = 864, 10_976
FEW, MANY = 4_000, 14_000
# As cachegrind's summary names them: instructions, reads and writes that miss the first and the
# last level.
COUNTS = 'Ir', 'D1mr', 'D1mw', 'DLmr', 'DLmw'


def report() -> None:
    """Print the counts for each number of beads."""
    if not shutil.which('valgrind'):
        raise SystemExit('benchmarks: no valgrind on PATH; install it')
    print('        N   instructions   misses of L1   of a last level of 2 MB   (per collision)')
    for n in SIZES:
        few, many = (counted(n, collisions) for collisions in (FEW, MANY))
        per = [(many[k] - few[k]) / (many['done'] - few['done']) for k in COUNTS]
        print(f'{n:9d}   {per[0]:12.0f}   {per[1] + per[2]:12.1f}   {per[3] + per[4]:14.1f}')


def counted(n: int, collisions: int) -> dict[str, float]:
    """Counts of a run, and how many collisions there were in it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, 'counts')
        program = [sys.executable, '-m', 'benchmarks.engine_profile', str(n), str(collisions)]
        valgrind = [
            *('valgrind', '--tool=cachegrind', '--cache-sim=yes', '--smc-check=all'),
            *('--LL=2097152,16,64', f'--cachegrind-out-file={file}'),
        ]
        plain = {'NUMBA_CPU_NAME': 'generic', 'NUMBA_CPU_FEATURES': '+sse2'}
        environment = {**os.environ, **plain}
        subprocess.run(program, check=True, capture_output=True, env=environment)
        done = subprocess.run(
            [*valgrind, *program], check=True, capture_output=True, text=True, env=environment
        )
        text = file.read_text()
    events = re.search(r'^events: (.*)$', text, re.MULTILINE)
    summary = re.search(r'^summary: (.*)$', text, re.MULTILINE)
    if events is None or summary is None:
        raise SystemExit('benchmarks: valgrind wrote no summary; use 3.19 or later')
    counts = dict(zip(events[1].split(), map(float, summary[1].split()), strict=True))
    return {**counts, 'done': float(done.stdout.split()[-1])}


def follow(n: int, collisions: int) -> None:
    """Follow a gas and print how many collisions there were."""
    gas = gas_of(n, DENSE, periodic=True)
    gas.run_until(2.0 * collisions / n * mean_free_time(DENSE))
    print(gas.counts.pair)


if __name__ == '__main__':
    if len(sys.argv) == 3:
        follow(int(sys.argv[1]), int(sys.argv[2]))
    else:
        report()
