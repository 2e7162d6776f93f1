"""Restitutions from contacts alone, of a gas at rest and of one that falls."""

from __future__ import annotations

import numpy as np

from benchmarks.accelerated_tray import AcceleratedTray
from benchmarks.contacts import tracks_of
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts_alone import contacts_alone
from nanorocks_ros.settings import PipelineSettings, PriorSettings, SimulationSettings
from nanorocks_ros.stages.contact_restitution.track_contacts import track_contacts

PAIRS, WALLS = 0.85, 0.93
RUNS, FRAMES = 8, 300
TRAY = load_trays()[1]


def tracks(seed, acceleration):
    """Tracks of a gas of tray 1, with errors of the places."""
    settings = SimulationSettings(
        restitution=PAIRS, wall_restitution=WALLS, seed=seed, mean_speed=0.010, first_shake=0.0
    )
    gas = AcceleratedTray(settings, TRAY, 0, acceleration)
    return list(tracks_of(gas, TRAY, np.random.default_rng(seed), FRAMES))


def report():
    """Print a line for each acceleration and for told and untold walls."""
    print(f'Tray 1, {RUNS} runs of {FRAMES / 30:g} s, beads {PAIRS}, walls {WALLS}.\n')
    print('| acceleration [mm/s²] | walls | measured | collisions | beads | rebounds | walls |')
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for acceleration in ((0.0, 1e-9, 0.0), (0.004, -0.003, 0.0)):
        runs = [tracks(seed, acceleration) for seed in range(1, RUNS + 1)]
        for known in (True, False):
            results = [
                track_contacts(run, TRAY, PipelineSettings(), container_known=known)
                for run in runs
            ]
            sizes = [1e3 * result.acceleration.size for result in results]
            contacts = [contact for result in results for contact in result.contacts]
            alone = contacts_alone(contacts, (), PriorSettings())
            beads, walls = alone.beads.restitution, alone.walls.restitution
            print(
                f'| {1e3 * np.hypot(*acceleration[:2]):.1f} | {"told" if known else "found"} | '
                f'{np.mean(sizes):.2f} ± {np.std(sizes):.2f} | {alone.beads.contacts} | '
                f'{beads.value:.3f} ± {beads.error:.3f} | {alone.walls.contacts} | '
                f'{walls.value:.4f} ± {walls.error:.4f} |',
                flush=True,
            )


if __name__ == '__main__':
    report()
