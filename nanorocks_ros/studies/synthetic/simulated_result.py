"""Simulated runs of a tray: decays, beads and collisions of each, and their means.

Tested by ``test/studies/synthetic/test_simulated_runs.py``.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.simulation.engine.event_counts import EventCounts
    from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRun:
    """One run of a tray after a shaking event.

    Parameters
    ----------
    number : int
        Number of the run, from 0.
    mean_speed, mean_projected_speed : ndarray (samples,), [m/s]
    bodies : ndarray of int64, (samples,)
        Number of bodies; beads that stick together are one.
    counts : EventCounts
    cpu_seconds : float, [s]
    radii, masses : ndarray (n,), [m], [kg]
    drag : ndarray (n,) or None, [1/s]
        Rate at which the gas slows each bead; None in a vacuum.
    positions, velocities : ndarray (n_kept, n, 3), [m], [m/s]
        At the times of `SimulationPlan.bead_times`.
    spins : ndarray (n_kept, n, 3) or None, [rad/s]
        As of `RunRecord`; None for smooth beads without bodies that turn.
    body : ndarray of int32, (n_kept, n)
        Body of each bead: the smallest bead number in it.
    events : structured ndarray (n_events,)
        As `run_record.EVENT`; empty unless they are kept.
    """

    number: int
    mean_speed: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    bodies: NDArray[np.int64]
    counts: EventCounts
    cpu_seconds: float
    radii: NDArray[np.float64]
    masses: NDArray[np.float64]
    drag: NDArray[np.float64] | None
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64] | None
    body: NDArray[np.int32]
    events: NDArray[np.void]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRuns:
    """All runs of a plan, in their order.

    Parameters
    ----------
    plan : SimulationPlan
    runs : tuple of SimulatedRun
    """

    plan: SimulationPlan
    runs: tuple[SimulatedRun, ...]

    def mean(self, name: str) -> NDArray[np.float64]:
        """Mean of a curve over the runs, (samples,)."""
        mean: NDArray[np.float64] = self._curves(name).mean(axis=0)
        return mean

    def error(self, name: str) -> NDArray[np.float64] | None:
        """Standard error of the mean of a curve; None for a single run."""
        if len(self.runs) == 1:
            return None
        curves = self._curves(name)
        error: NDArray[np.float64] = curves.std(axis=0, ddof=1) / math.sqrt(len(curves))
        return error

    def _curves(self, name: str) -> NDArray[np.float64]:
        return np.array([getattr(run, name) for run in self.runs], dtype=np.float64)

    def count(self, name: str) -> int:
        """Number of events of a kind in all runs."""
        return sum(getattr(run.counts, name) for run in self.runs)

    @property
    def events(self) -> int:
        """Number of collisions with beads and walls, merges, and beads that stuck to a wall."""
        return sum(self.count(name) for name in ('pair', 'wall', 'merge', 'fix'))

    @property
    def cpu_seconds(self) -> float:
        """Processor time of all runs, [s]."""
        return math.fsum(run.cpu_seconds for run in self.runs)

    @property
    def filling_factor(self) -> float:
        """Filling factor of the tray; the sizes of beads are drawn in each run."""
        cubes = math.fsum(math.fsum((run.radii**3).tolist()) for run in self.runs)
        return 4.0 / 3.0 * math.pi * cubes / len(self.runs) / self.plan.tray.volume

    @property
    def half_time(self) -> float | None:
        """Time at which the mean speed has halved, [s]; None after the end of the runs."""
        speed, times = self.mean('mean_speed'), self.plan.times
        half = 0.5 * speed[0]
        below = np.flatnonzero(speed <= half)
        if not below.size or half <= 0.0:
            return None
        k = int(below[0])
        part = (speed[k - 1] - half) / (speed[k - 1] - speed[k])
        return float(times[k - 1] + part * (times[k] - times[k - 1]))

    def provenance(self) -> str:
        """Everything that the runs depend on, as JSON; units are SI."""
        return json.dumps(self.plan.provenance(), sort_keys=True)
