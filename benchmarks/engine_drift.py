"""A long run: energy, momentum and overlap after many events.

`python -m benchmarks.engine_drift 1e9` runs a billion events; the default is 2e7.
"""

from __future__ import annotations

import sys

import numpy as np
from tqdm import tqdm

from benchmarks.engine import DENSE, gas_of, mean_free_time

N = 864
STEPS = 100


def report(events: float = 2e7) -> None:
    """Print the drift at five points of the run."""
    gas = gas_of(N, DENSE, periodic=True)
    first = gas.beads()
    energy = np.sum(first.velocities**2)
    span = events / N * 2.0 * mean_free_time(DENSE)
    print('    collisions   energy - 1      momentum / bead   smallest gap   collision rate')
    before = 0
    with tqdm(total=STEPS, disable=None, leave=False) as bar:
        for step in range(1, STEPS + 1):
            gas.run_until(span * step / STEPS)
            bar.update()
            if step % (STEPS // 5):
                continue
            now = gas.beads()
            pairs = gas.counts.pair
            drift = np.sum(now.velocities**2) / energy - 1.0
            momentum = np.abs(now.velocities.mean(axis=0)).max()
            rate = 2.0 * (pairs - before) / N / (span / 5) * mean_free_time(DENSE)
            before = pairs
            print(
                f'{pairs:14d}   {drift:+.1e}        {momentum:.1e}'
                f'           {smallest_gap(now.positions):+.1e}      {rate:.4f}',
                flush=True,
            )


def smallest_gap(positions: np.ndarray) -> float:
    """Smallest distance between two surfaces."""
    side = (N / DENSE) ** (1.0 / 3.0)
    apart = positions[:, np.newaxis] - positions
    apart -= side * np.rint(apart / side)
    distance = np.sqrt(np.sum(apart**2, axis=-1))
    return float(np.min(distance[np.triu_indices(N, 1)]) - 1.0)


if __name__ == '__main__':
    report(float(sys.argv[1]) if len(sys.argv) > 1 else 2e7)
