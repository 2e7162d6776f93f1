"""Decay libraries of the package: how they were made, and their misfit.

The misfit is that of the functions beyond the noise of the runs, in ln v; with friction there is
a further one in proportion to the friction, given here for one of 0.01.
"""

from __future__ import annotations

import json
from importlib.resources import files

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference import decay
from nanorocks_ros.inference.decay.decay_library_file import library_of


def report() -> None:
    """Print the table."""
    print(
        '\n| tray | nodes | rough nodes | runs at each | misfit | with a friction of 0.01 '
        '| file [kB] |\n' + '| --- ' * 7 + '|'
    )
    for number, tray in load_trays().items():
        library = library_of(tray)
        made = json.loads(library.made_by)
        rubbing = f'{library.friction_misfit:.1f} %' if library.rough else 'smooth only'
        size = len(files(decay).joinpath(f'libraries/tray_{number}.npz').read_bytes())
        print(
            f'| {number} | {made["nodes"]} | {made["rough_nodes"]} | {made["runs"]} | '
            f'{100.0 * library.misfit:.1f} % | {rubbing} | '
            f'{size / 1e3:.0f} |'
        )
