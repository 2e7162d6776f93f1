"""Filling factors and apparent compaction of simulated clusters, which are rigid.

18 cycles a row, 60 s each, shaken to 10 mm/s, restitutions 0.89 and 0.97. Filling factors are
those of the end of a cycle, from true places; "apparent" is (ff_end - ff_min) / ff_min by the
paper's rule from the autocorrelation of rendered pictures, one a second, mean and standard error
over cycles; "from 10 s on" is the same from a fixed time, 6 to 14 s after the shaking event. Rows
without sticking are controls: nothing in them can become compact.
"""

from __future__ import annotations

import numpy as np

from nanorocks_ros.experiment.settings import SimulationSettings
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.packing import HEXAGONAL_LAYER, PAPER_COMPACTION
from nanorocks_ros.study.packing import compaction, simulated_packing

_SPEEDS = (0.0, 0.001, 0.003, 0.0104)
_CYCLES = 18


def _mean(values: list[float], digits: int = 3, percent: bool = False) -> str:
    known = np.array(values)[np.isfinite(values)] * (100.0 if percent else 1.0)
    if known.size == 0:
        return ''
    if known.size == 1:
        return f'{known[0]:.{digits}f}'
    return f'{known.mean():.{digits}f} ± {known.std(ddof=1) / np.sqrt(known.size):.{digits}f}'


def report() -> None:
    print(f'Of a flat layer, hexagonal order fills {HEXAGONAL_LAYER:.4f}.\n')
    print(
        '| tray | sticking speed, mm/s | beads per cluster | layer A 2R | true height | paper A R '
        '| apparent compaction, % | from 10 s on, % | true, % | paper, % |'
    )
    print('| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |')
    for number, printed in PAPER_COMPACTION.items():
        tray = load_trays()[number]
        for speed in _SPEEDS:
            settings = SimulationSettings(
                restitution=0.89,
                wall_restitution=0.97,
                mean_speed=0.010,
                sticking_speed=speed,
                seed=6,
            )
            curves = simulated_packing(tray, settings, _CYCLES)
            ends = [compaction(one) for one in curves]
            print(
                f'| {number} | {1e3 * speed:g} | {_mean([c.beads[-1] for c in curves], 1)} | '
                f'{_mean([c.filling[-1] for c in curves])} | '
                f'{_mean([c.in_space[-1] for c in curves])} | '
                f'{_mean([c.paper[-1] for c in curves])} | '
                f'{_mean([one.apparent for one in ends], 1, True)} | '
                f'{_mean([one.settled for one in ends], 1, True)} | '
                f'{_mean([one.true for one in ends], 1, True)} | {100 * printed:.1f} |',
                flush=True,
            )


if __name__ == '__main__':
    report()
