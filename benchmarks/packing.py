"""Filling factors and apparent compaction of simulated clusters, which are rigid.

18 cycles per row, 60 s each, shaken to 10 mm/s, restitutions 0.89 and 0.97. Filling factors are
those at the end of a cycle, from true positions; "apparent" is (ff_end - ff_min) / ff_min by the
paper's rule from the autocorrelation of rendered images at 1 Hz, mean and standard error over
cycles; "from 10 s on" is the same from a fixed time, 6 to 14 s after the shaking event. Rows
without sticking are controls, in which no compaction is possible.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.contacts import true_tracks
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.filling_factor import HEXAGONAL_LAYER, PAPER_COMPACTION
from nanorocks_ros.records import Merge
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.clusters.packing_density import bodies_of_pairs, packing_of_clusters
from nanorocks_ros.studies.analysis.cluster_packing import compaction
from nanorocks_ros.studies.analysis.simulated_packing import simulated_packing

_SPEEDS = (0.0, 0.001, 0.003, 0.0104)
_CYCLES = 18
# Rows from tracks: cycles, frames at 30 Hz, and sticking speeds.
_TRACKED, _PICTURES, _TRACKED_SPEEDS = 4, 900, (0.001, 0.003)


def _settings(speed: float, **more: float) -> SimulationSettings:
    return SimulationSettings(
        restitution=0.89,
        wall_restitution=0.97,
        mean_speed=0.010,
        sticking_speed=speed,
        aggregate_motion='translating',
        seed=6,
        **more,
    )


def _mean(values: list[float], digits: int = 3, percent: bool = False) -> str:
    finite = np.array(values)[np.isfinite(values)] * (100.0 if percent else 1.0)
    if finite.size == 0:
        return ''
    if finite.size == 1:
        return f'{finite[0]:.{digits}f}'
    return f'{finite.mean():.{digits}f} ± {finite.std(ddof=1) / np.sqrt(finite.size):.{digits}f}'


def _from_tracks(number: int, speed: float) -> None:
    """Print a row of filling factors 30 s after a shaking event, from tracks and the truth."""
    tray = load_trays()[number]
    settings = _settings(speed, tray=number, first_shake=0.0, frame_rate=30.0)
    fillings, true, errors, beads, true_beads = [], [], [], [], []
    for run in range(_TRACKED):
        gas, counter, pairs = (
            ShakenTray(settings, tray, run),
            BodyCounter(PipelineSettings(), tray),
            [],
        )
        moments = gas.moments(_PICTURES)
        for tracks in true_tracks(tray, settings, run, _PICTURES):
            moment = next(moments)
            records = counter.push(replace(tracks, cycle=1))
            merges = [record for record in records if isinstance(record, Merge)]
            pairs += [tuple(merge.tracks.tolist()) for merge in merges]
        height = tray.dimensions[2]
        truth = packing_of_clusters(moment.positions[:, :2], gas.radii, gas.bodies, height)
        packing = packing_of_clusters(
            tracks.positions, tracks.radii, bodies_of_pairs(tracks.ids, pairs), height
        )
        if truth is None or packing is None:
            continue
        true.append(truth.filling)
        fillings.append(packing.filling)
        errors.append(packing.filling / truth.filling - 1.0)
        beads.append(packing.beads)
        true_beads.append(truth.beads)
    print(
        f'| {number} | {1e3 * speed:g} | {_mean(true_beads, 1)} | {_mean(beads, 1)} | '
        f'{_mean(true)} | {_mean(fillings)} | {_mean(errors, 1, True)} |',
        flush=True,
    )


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
            curves = simulated_packing(tray, _settings(speed), _CYCLES)
            ends = [compaction(curve) for curve in curves]
            print(
                f'| {number} | {1e3 * speed:g} | {_mean([c.beads[-1] for c in curves], 1)} | '
                f'{_mean([c.filling[-1] for c in curves])} | '
                f'{_mean([c.in_space[-1] for c in curves])} | '
                f'{_mean([c.paper[-1] for c in curves])} | '
                f'{_mean([result.apparent for result in ends], 1, True)} | '
                f'{_mean([result.settled for result in ends], 1, True)} | '
                f'{_mean([result.true for result in ends], 1, True)} | {100 * printed:.1f} |',
                flush=True,
            )
    print(
        f'\nFrom tracks that lose no bead, with the errors of tracking, {_TRACKED} cycles, 30 s '
        'after the shaking event:\n'
    )
    print(
        '| tray | sticking speed, mm/s | beads per cluster | from tracks | layer A 2R | '
        'from tracks | error, % |'
    )
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for number in PAPER_COMPACTION:
        for speed in _TRACKED_SPEEDS:
            _from_tracks(number, speed)


if __name__ == '__main__':
    report()
