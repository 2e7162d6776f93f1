"""``python -m nanorocks_ros.tools.compilation.function_list``: renew `compiled_functions.txt`.

Tested by ``test/tools/compilation/test_parallel_compilation.py``.

Runs the commands of `COMMANDS` and the warm-up of the nodes with an empty folder of kernels,
minutes, and writes down what they and their worker processes left there. ``--check`` compares
instead: it says what the list lacks, or has beyond that, and exits with 1.

The largest kernels come first: they take longest to compile, and no process should be left alone
with one of them at the end.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from nanorocks_ros.numerics.compilation.compiled_versions import CompiledVersion, versions_on_disk
from nanorocks_ros.tools.compilation.parallel_compilation import LIST, listed_versions

_OWN = Path(__file__).with_name(LIST)
_ROOT = Path(__file__).parents[3]
_BAG = _ROOT / 'bags' / 'tray_1_sample'

# What the guide, the tutorial and the pages of use do, with films as short as they can be.
_TRAY = (
    '--corners 3 3 205 205 --sides-mm 15 15 --height-mm 3 --diameter-px 27 --diameter-mm 2 '
    '--count 15 --density-g-cm3 1.18'
)
STUCK = (
    'simulate --tray 1 --seed 3 --sticking-speed 0.005 --duration 12 --width-px 208 '
    '--height-px 208 --video stuck.avi'
)
"""Beads soon stick, and their bodies turn and rebound."""
COMMANDS = (
    f'analyse {_BAG} -o sample',
    f'statistics {_BAG}',
    f'speeds {_BAG}',
    f'autocorrelation {_BAG}',
    'simulate --tray 1 --seed 3 --restitution 0.8 --duration 8 --width-px 208 --height-px 208 '
    '--video film.avi',
    f'tray film.avi {_TRAY} -o mine.yaml --picture mine.png',
    f'tray film.avi {_TRAY.replace("3 3 205 205", "3 3 205 6 202 205 6 202")} -o turned.yaml',
    'measure film.avi --diameter-px 27 -o quick',
    'measure film.avi --diameter-px auto -o auto',
    'measure film.avi --trays-file mine.yaml -o measured',
    'measure film.avi --trays-file turned.yaml -o turned',
    'import ball --rate 60 -o fall',
    'measure fall --diameter-px 24 -o accelerated',
    STUCK,
    'measure stuck.avi --trays 1 -o stuck',
    'library --tray 1 --nodes 254 --rough-nodes 188 --runs 2 -o library.npz',
    'simulate --scene --duration 2 --first-shake 0.5 --effects all --bag plate',
    'analyse plate --preprocess-layout plate -o plate_results',
    'track plate --preprocess-layout plate --trays 3 5 -o tracks.csv',
)
_WARM_UP = """
from nanorocks_ros.pipeline import warm_up
for name, function in list(vars(warm_up).items()):
    if name.startswith('warm_up'):
        function()
"""


def used_versions(folder: Path) -> dict[CompiledVersion, int]:
    """What commands and nodes compile, and the sizes of it in bytes.

    Parameters
    ----------
    folder : Path
        An empty one, for films, results and kernels.
    """
    os.environ['NUMBA_CACHE_DIR'] = str(folder / 'kernels')
    draw_ball(folder / 'ball')
    _run(['-c', _WARM_UP], folder)
    for command in COMMANDS:
        print(f'nanorocks {command}', file=sys.stderr, flush=True)
        main = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
        _run(['-c', main, *command.split()], folder)
    return versions_on_disk()


def _run(arguments: list[str], folder: Path) -> None:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, check=False, capture_output=True, text=True
    )
    # 3: beads are not recognised well enough for a result.
    if done.returncode not in (0, 3):
        sys.exit(f'exit code {done.returncode}: {done.stderr}')


def draw_ball(folder: Path) -> None:
    """Pictures of a dark ball that falls onto a floor and rebounds, 60 a second."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    period, highest = 0.9, 150.0
    for number in range(190):
        image = np.full((240, 320, 3), 190, dtype=np.uint8)
        time = number / 60.0
        height = highest * (1.0 - (2.0 * (time % period) / period - 1.0) ** 2)
        centre = round(16.0 * (40.0 + 45.0 * time)), round(16.0 * (198.0 - height))
        cv2.circle(image, centre, round(16.0 * 12.0), (45, 45, 45), -1, cv2.LINE_AA, 4)
        noisy = np.clip(image + rng.normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f'{number:04d}.png'), noisy)


def main() -> int:
    """Renew or check the list; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--check', action='store_true', help='compare, write nothing')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        sizes = used_versions(Path(name))
    if options.check:
        listed = set(listed_versions())
        for version in sorted(sizes.keys() - listed):
            print(f'missing: {version}')
        for version in sorted(listed - sizes.keys()):
            print(f'not used: {version}')
        return int(listed != sizes.keys())
    by_size = sorted(sizes, key=lambda version: (-sizes[version], version))
    _OWN.write_text(''.join(f'{version}\n' for version in by_size), encoding='utf-8')
    print(f'{_OWN}: {len(by_size)} functions')
    return 0


if __name__ == '__main__':
    sys.exit(main())
