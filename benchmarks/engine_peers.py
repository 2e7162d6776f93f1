"""The same gas in other event-driven programs, where they are installed.

DynamO: `dynarun` and `dynamod` on PATH or in NANOROCKS_DYNAMO (a folder). FSmallenburg/EDMD: its
folder `Single` in NANOROCKS_EDMD, built here with gcc and its author's flags.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

# Complete face-centred crystals, the same for all programs.
SIZES = 864, 10_976, 97_556
ROUNDS = 3
DENSITY = 0.5
WORK = 1_000_000
MEAN_FREE_TIME = 0.1303


def report_peers(ours: Callable[[int], float]) -> None:
    """Print collisions a second of each program, and how much faster this one is.

    Parameters
    ----------
    ours : callable
        Number of beads to collisions per CPU second.
    """
    peers = [
        (name, peer) for name, peer in (('DynamO', dynamo()), ('EDMD', smallenburg())) if peer
    ]
    print('\nelastic, periodic, n = 0.5: collisions per CPU second, in turn, median of three\n')
    if not peers:
        print('no other program found; set NANOROCKS_DYNAMO or NANOROCKS_EDMD (see the source)')
    for n in SIZES:
        rounds = [[ours(n)] + [peer(n) for _, peer in peers] for _ in range(ROUNDS)]
        rates = np.array(rounds)
        line = f'N = {n:6d}   this {np.median(rates[:, 0]):9.0f}'
        for k, (name, _) in enumerate(peers, start=1):
            ratio = np.median(rates[:, 0] / rates[:, k])
            line += f'   {name} {np.median(rates[:, k]):9.0f} (ratio {ratio:.2f})'
        print(line, flush=True)


def cpu_seconds(command: list[str], folder: Path) -> float:
    """CPU time of a program."""
    before = os.times()
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    after = os.times()
    return after.children_user - before.children_user


def smallenburg() -> Callable[[int], float] | None:
    """Collisions per CPU second of FSmallenburg/EDMD, or None where it is not installed."""
    source = os.environ.get('NANOROCKS_EDMD')
    if not source or not shutil.which('gcc'):
        return None

    def rate(n: int) -> float:
        span = round(2.0 * WORK / n * MEAN_FREE_TIME, 2)
        text = Path(source, 'mdSingle.c').read_text()
        for name, value in (
            ('usethermostat', '0'),
            ('initialconfig', '1'),
            ('packfrac', repr(DENSITY * np.pi / 6.0)),
            ('N', str(n)),
            ('maxtime', repr(span)),
            ('writeinterval', '1e6'),
        ):
            text, replaced = re.subn(rf'(\b{name} *= *)[0-9.]+;', rf'\g<1>{value};', text, count=1)
            if not replaced:
                raise SystemExit(f'benchmarks: {source}: no {name}; use another release')
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(source, folder, dirs_exist_ok=True)
            Path(folder, 'run.c').write_text(text)
            flags = ['-w', '-Ofast', '-funroll-loops', '-march=native']
            subprocess.run(['gcc', *flags, 'run.c', '-o', 'run', '-lm'], cwd=folder, check=True)
            seconds = cpu_seconds(['./run'], Path(folder))
        return n * span / (2.0 * MEAN_FREE_TIME) / seconds

    return rate


def dynamo() -> Callable[[int], float] | None:
    """Collisions per CPU second of DynamO, or None where it is not installed."""
    path = os.pathsep.join(filter(None, (os.environ.get('NANOROCKS_DYNAMO'), os.environ['PATH'])))
    run, make = shutil.which('dynarun', path=path), shutil.which('dynamod', path=path)
    if not (run and make):
        return None

    def rate(n: int) -> float:
        cells = round((n / 4.0) ** (1.0 / 3.0))
        crystal = ['-m', '0', '-d', str(DENSITY), '-C', str(cells), '-o', 'start.xml']
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([make, *crystal], cwd=folder, check=True, capture_output=True)
            part = ['--out-config-file', 'end.xml.bz2', '--out-data-file', 'data.xml.bz2']
            cpu_seconds([run, 'start.xml', '-c', str(8 * n), *part], Path(folder))
            # The difference leaves out reading, sorting and writing the configuration.
            short, long = (
                dynamo_run([run, 'end.xml.bz2', '-c', str(events)], Path(folder))
                for events in (WORK // 40, WORK // 4)
            )
        return (long[0] - short[0]) / (long[1] - short[1])

    return rate


def dynamo_run(command: list[str], folder: Path) -> tuple[int, float]:
    """Number of collisions that DynamO reports, and its CPU time."""
    seconds = cpu_seconds(
        [*command, '--out-config-file', 'no.xml', '--out-data-file', 'data.xml'], folder
    )
    match = re.search(r'TwoParticleEvents="(\d+)"', Path(folder, 'data.xml').read_text())
    if match is None:
        raise SystemExit('benchmarks: DynamO wrote no number of collisions; use another release')
    return int(match[1]), seconds
