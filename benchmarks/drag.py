"""Drag of a gas from one cycle, and the intervals of both restitutions in it.

True tracks with the errors of tracking (`benchmarks.contacts`) and mean speeds with errors of 2 %,
20 s from 10 mm/s, restitutions 0.89 and 0.97; then with friction besides, tangential restitution
0.4. "Holds" is the share of 95 % intervals of the headline with the truth. For a mixture the drag
is that of the first species. ``docs/method/restitution.md`` has the conclusions.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import rough_gas as gas
from benchmarks.contacts import contacts_of, true_tracks
from benchmarks.coverage import coverage
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Measured, Quality, SpeedEstimate, SpeedMethod
from nanorocks_ros.settings import CoolingSettings, PipelineSettings
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence

    from benchmarks.contacts import Contacts
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import CorEstimate, Tracks
    from nanorocks_ros.settings import SimulationSettings

_TRAYS = (1, 3)
# Drag and friction of each row.
_ROWS = (
    *((drag, 0.0) for drag in (0.0, 0.005, 0.02, 0.07)),
    *((0.0, friction) for friction in (0.01, 0.03)),
    *((0.02, friction) for friction in (0.01, 0.03)),
)
_CYCLES = 40
FRAMES = 600
_EVERY, _ERROR = 3, 0.02
_TRUTH = gas.PAIRS, gas.WALLS
_FINAL_ONLY = PipelineSettings(cooling=CoolingSettings(update_interval=60.0))


def estimate_of_cycle(tray: Tray, settings: SimulationSettings, run: int) -> CorEstimate:
    """The final estimate of one simulated cycle."""
    tracks = list(true_tracks(tray, settings, run, FRAMES))
    return estimate_of_tracks(tray, settings, run, tracks, contacts_of(tray, iter(tracks)))


def estimate_of_tracks(
    tray: Tray,
    settings: SimulationSettings,
    run: int,
    tracks: Sequence[Tracks],
    contacts: Contacts,
) -> CorEstimate:
    """The final estimate of a cycle, by the stages that read films and cameras.

    Parameters
    ----------
    tray : Tray
        As told to the stages.
    settings : SimulationSettings
    run : int
        Draws the errors of the speeds, with the seed of the settings.
    tracks : sequence of Tracks
        Of each frame, from the shaking event on.
    contacts : tuple
        Found in the tracks.
    """
    noise = np.random.default_rng([settings.seed, run, 2]).standard_normal(len(tracks))
    estimator = RestitutionEstimator(_FINAL_ONLY, tray)
    for contact in contacts:
        estimator.push(contact)
    for frame in range(0, len(tracks), _EVERY):
        mean = float(np.hypot(*tracks[frame].velocities.T).mean())
        speed = mean * math.exp(_ERROR * noise[frame])
        estimator.push(
            SpeedEstimate(
                stamp_ns=tracks[frame].stamp_ns,
                tray=tray.number,
                cycle=1,
                cycle_start_ns=0,
                method=SpeedMethod.TRACKING,
                mean_projected_speed=Measured(speed, _ERROR * speed),
                window=1.0 / settings.frame_rate,
                tray_speed=0.0,
            )
        )
    return estimator.flush()[-1]


def report(cycles: int = _CYCLES) -> None:
    """Print the table.

    Parameters
    ----------
    cycles : int
        In each row.
    """
    print(
        '\n| tray | drag [1/s] | friction | drag found ± sd of a cycle | stated sd | acceleration '
        'above 0 | beads: holds | half-width | over ideal | median error | walls: holds | '
        'half-width | over ideal | median error |\n' + '| --- ' * 14 + '|'
    )
    for number in _TRAYS:
        tray = load_trays()[number]
        ideal: list[float] = []
        for drag, friction in _ROWS:
            rough = gas.Roughness(tangential=0.4, friction=friction) if friction else gas.SMOOTH
            settings = gas.settings_of(tray, rough, drag=drag, seed=2027)
            estimates = [estimate_of_cycle(tray, settings, run) for run in range(cycles)]
            cells, halves = _cells(estimates, ideal)
            ideal = ideal or halves
            print(f'| {number} | {drag:g} | {friction:g} | {cells} |', flush=True)


def _cells(estimates: list[CorEstimate], ideal: list[float]) -> tuple[str, list[float]]:
    """All cells but those of the case, and half-widths of the intervals of beads and walls."""
    drags = np.array([(estimate.drag.value, estimate.drag.error) for estimate in estimates])
    accelerated = np.mean([Quality.ACCELERATED in estimate.quality for estimate in estimates])
    cells = [
        f'{drags[:, 0].mean():.4f} ± {drags[:, 0].std(ddof=1):.4f}',
        f'{drags[:, 1].mean():.4f}',
        f'{accelerated:.2f}',
    ]
    halves = []
    for k, (name, truth) in enumerate(
        zip(('restitution', 'wall_restitution'), _TRUTH, strict=True)
    ):
        seen = coverage((getattr(estimate, name) for estimate in estimates), truth)
        halves.append(seen.half_width)
        ratio = f'{seen.half_width / ideal[k]:.2f}' if ideal else '1'
        cells += [
            f'{seen.holds:.2f}',
            f'{seen.half_width:.4f}',
            ratio,
            f'{seen.median_error:+.4f}',
        ]
    return ' | '.join(cells), halves
