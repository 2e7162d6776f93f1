"""A tray of one's own: a drawn film of 24 steel beads, by the two commands of the README."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BEADS, WALLS = 0.85, 0.93
SCALE, SIZE = 8000, (832, 592)
TRAY = """materials:
  steel: {density_g_cm3: 7.85, color_bgr: [150, 150, 150]}
trays:
  1:
    dimensions_mm: [90, 60, 4]
    species:
      - {material: steel, diameter_mm: 3, count: 24}
"""
FILM = (
    *('simulate', '--tray', '1', '--trays-file', 'steel.yaml', '--duration', '40'),
    *('--mean-speed', '0.02', '--restitution', f'{BEADS}', '--wall-restitution', f'{WALLS}'),
    *('--width-px', f'{SIZE[0]}', '--height-px', f'{SIZE[1]}'),
    *('--pixels-per-metre', f'{SCALE}', '--seed', '5', '--video', 'film.mp4'),
)
ALONE = ('measure', 'film.mp4', '--diameter-px', '24', '-o', 'alone')
DESCRIBE = (
    *('tray', 'film.mp4', '--corners', '56', '56', '776', '536', '--sides-mm', '90', '60'),
    *('--height-mm', '4', '--diameter-px', '24', '--diameter-mm', '3', '-o', 'mine.yaml'),
)
MEASURE = ('measure', 'film.mp4', '--trays-file', 'mine.yaml', '-o', 'out')


def run(folder, arguments):
    """Run a command; prints its lines, and processor time of it and of its workers."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    code = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'
    done = subprocess.run(
        [sys.executable, '-c', code, *arguments], cwd=folder, capture_output=True, text=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f'\n    nanorocks {" ".join(arguments)}\n')
    print('\n'.join(f'    {line[:160]}' for line in done.stdout.splitlines()))
    if done.returncode:
        print(done.stderr)
    wall = time.perf_counter() - start
    print(
        f'\n{spent:.0f} s of processor time, {wall:.0f} s, exit code {done.returncode}', flush=True
    )


def report():
    """Draw the film, and run the commands in a fresh folder."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / 'steel.yaml').write_text(TRAY)
        for arguments in (FILM, ALONE, DESCRIBE, MEASURE):
            run(folder, arguments)


if __name__ == '__main__':
    report()
