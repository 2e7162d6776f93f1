"""Bodies that turn, in the engine: conservation, cost, and the clusters that they form.

Cycles of 58 s after a kick to 10 mm/s, restitutions 0.89 and 0.97.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking

_TRAYS = (1, 3, 5)
_SECONDS, _FRAMES = 58.0, 581
_RUNS = 18
_MM = 1e3
_SPEED = 3e-3
# Sticking speed [m/s] and its width, break-up speed; each for the trays above.
_CASES = (
    ('1 mm/s', {'sticking_speed': 1e-3}),
    ('3 mm/s', {'sticking_speed': _SPEED}),
    ('10 mm/s', {'sticking_speed': 10e-3}),
    ('3 mm/s, does not turn', {'sticking_speed': _SPEED, 'aggregate_motion': 'translating'}),
    ('3 mm/s, falling over 6 mm/s', {'sticking_speed': _SPEED, 'sticking_speed_width': 6e-3}),
    ('3 mm/s, breaks at 4 mm/s', {'sticking_speed': _SPEED, 'break_up_speed': 4e-3}),
    ('3 mm/s, walls hold at 1 mm/s', {'sticking_speed': _SPEED, 'wall_sticking_speed': 1e-3}),
)
_TURNING = slice(0, 3)
# Of a cycle, at which clusters are counted, [s].
_INSTANTS = (20.0, _SECONDS)
# Places in the ledger.
_ENERGY, _MOMENTUM, _TO_WALLS = slice(0, 3), slice(9, 12), slice(12, 15)


class Clusters(NamedTuple):
    """Bodies of a cycle, counted: two or more beads are a cluster.

    Parameters
    ----------
    clusters, beads_per_cluster, share : float
        As in the paper's Table 3; the mean is NaN without a cluster.
    mean_size, weighted_size : float
        Beads per body, and the mean over the beads of the size of their body.
    """

    clusters: float
    beads_per_cluster: float
    share: float
    mean_size: float
    weighted_size: float


def clusters_of(bodies: np.ndarray) -> Clusters:
    """Count clusters, from the number of the body of each bead."""
    sizes = np.unique(bodies, return_counts=True)[1]
    large = sizes[sizes > 1]
    return Clusters(
        clusters=float(large.size),
        beads_per_cluster=float(large.mean()) if large.size else np.nan,
        share=large.sum() / bodies.size,
        mean_size=float(sizes.mean()),
        weighted_size=float((sizes**2).sum() / bodies.size),
    )


def shaken_gas(number: int, run: int, **rules: float | str) -> HardSphereGas:
    """Gas of a tray that has just been kicked."""
    tray = load_trays()[number]
    settings = SimulationSettings(
        tray=number,
        seed=11,
        restitution=0.89,
        wall_restitution=0.97,
        mean_speed=0.010,
        **rules,
    )
    collisions = rules_of(settings, tray, run)
    beads = after_shaking(settings, collisions, resting_beads(settings, tray, run), run, 0)
    return HardSphereGas(beads, collisions)


def _smallest_gap(gas: HardSphereGas, positions: np.ndarray, box: tuple) -> float:
    """Smallest gap of two beads or a bead and a wall in all frames, in parts of a radius."""
    i, j = np.triu_indices(gas.radii.size, 1)
    reach = gas.radii[i] + gas.radii[j]
    smallest = np.inf
    for places in positions:
        apart = np.linalg.norm(places[j] - places[i], axis=1) - reach
        walls = np.minimum(places, np.array(box) - places) - gas.radii[:, np.newaxis]
        smallest = min(smallest, apart.min(), walls.min())
    return float(smallest / gas.radii.min())


def _conservation_row(number: int, name: str, rules: dict) -> str:
    gas = shaken_gas(number, 0, **rules)
    box = load_trays()[number].dimensions
    energy, momentum, moment = gas.energy, gas.momentum, gas.angular_momentum
    scale = float(gas.masses @ np.linalg.norm(gas.beads().velocities, axis=1))
    started = time.process_time()
    record = gas.follow(_SECONDS, np.linspace(0.0, _SECONDS, _FRAMES), log=True)
    seconds = time.process_time() - started
    ledger = gas.ledger
    errors = (
        abs(gas.energy + ledger[_ENERGY].sum() - energy) / energy,
        np.abs(gas.momentum + ledger[_MOMENTUM] - momentum).max() / scale,
        np.abs(gas.angular_momentum + ledger[_TO_WALLS] - moment).max() / (scale * max(box)),
    )
    sizes = np.unique(gas.bodies, return_counts=True)[1]
    cells = (
        f'{number}',
        name,
        f'{len(record.events)}',
        f'{sizes.max()}',
        f'{seconds:.3f}',
        f'{len(record.events) / seconds:.0f}',
        *(f'{error:.0e}' for error in errors),
        f'{_smallest_gap(gas, record.positions, box):.0e}',
    )
    return f'| {" | ".join(cells)} |'


def _mean(values: list[float], digits: int) -> str:
    known = np.array(values)[np.isfinite(values)]
    if known.size < 2:
        return '-'
    error = known.std(ddof=1) / np.sqrt(known.size)
    return f'{known.mean():.{digits}f} ± {error:.{digits}f}'


def _cluster_row(number: int, name: str, rules: dict, instant: float) -> str:
    counted = []
    for run in range(_RUNS):
        gas = shaken_gas(number, run, **rules)
        gas.run_until(instant)
        counted.append(clusters_of(gas.bodies))
    columns = list(zip(*counted, strict=True))
    cells = (
        f'{number}',
        name,
        f'{instant:g}',
        _mean(columns[0], 2),
        _mean(columns[1], 2),
        _mean([100.0 * share for share in columns[2]], 0),
        _mean(columns[3], 2),
        _mean(columns[4], 2),
    )
    return f'| {" | ".join(cells)} |'


def report() -> None:
    """Print the tables."""
    # Compiled before anything is timed.
    shaken_gas(1, 0, sticking_speed=_SPEED).follow(1.0, [0.5], log=True)
    shaken_gas(3, 0, sticking_speed=_SPEED).follow(1.0, [0.5], log=True)
    print(
        '| tray | sticks below | events | largest body | CPU [s] | events/s | energy | momentum '
        '| angular momentum | smallest gap / radius |\n' + '| --- ' * 10 + '|'
    )
    for number in _TRAYS:
        for name, rules in _CASES[_TURNING]:
            print(_conservation_row(number, name, rules), flush=True)
    print(
        f'\n{_RUNS} cycles each:\n\n'
        '| tray | sticks below | after [s] | clusters | beads per cluster | beads in clusters '
        '[%] | beads per body | weighted |\n' + '| --- ' * 8 + '|'
    )
    for number in _TRAYS:
        paper = PAPER_TABLE_3[number]
        print(
            f'| {number} | the paper, Table 3 | | {paper.clusters} | {paper.beads_per_cluster} '
            f'| {100.0 * paper.share:.0f} | | |'
        )
        for name, rules in _CASES:
            for instant in _INSTANTS:
                print(_cluster_row(number, name, rules, instant), flush=True)


if __name__ == '__main__':
    report()
