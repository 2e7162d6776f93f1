"""What several simulated runs of a tray have in common, and what their files say about them."""

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
        From 0; runs of one seed differ.
    mean_speed, mean_projected_speed : ndarray (samples,), [m/s]
    bodies : ndarray of int64, (samples,)
        Beads that move together count once.
    counts : EventCounts
    cpu_seconds : float, [s]
    radii, masses : ndarray (n,), [m], [kg]
    positions, velocities : ndarray (n_kept, n, 3), [m], [m/s]
        At the times at which beads are kept.
    spins : ndarray (n_kept, n, 3) or None, [rad/s]
        None for smooth beads.
    body : ndarray of int32, (n_kept, n)
        The smallest number of a bead in the body of each bead.
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
        """A curve averaged over the runs, (samples,)."""
        found: NDArray[np.float64] = self._curves(name).mean(axis=0)
        return found

    def error(self, name: str) -> NDArray[np.float64] | None:
        """Its standard error; None for a single run."""
        if len(self.runs) == 1:
            return None
        curves = self._curves(name)
        found: NDArray[np.float64] = curves.std(axis=0, ddof=1) / math.sqrt(len(curves))
        return found

    def _curves(self, name: str) -> NDArray[np.float64]:
        return np.array([getattr(run, name) for run in self.runs], dtype=np.float64)

    def count(self, name: str) -> int:
        """Events of a kind in all runs."""
        return sum(getattr(run.counts, name) for run in self.runs)

    @property
    def events(self) -> int:
        """Collisions of two beads and with walls, merges and beads that stuck to a wall."""
        return sum(self.count(name) for name in ('pair', 'wall', 'merge', 'fix'))

    @property
    def cpu_seconds(self) -> float:
        """Processor time of all runs, [s]."""
        return math.fsum(run.cpu_seconds for run in self.runs)

    @property
    def filling_factor(self) -> float:
        """Part of the tray that the beads fill; their sizes are drawn in each run."""
        cubes = math.fsum(math.fsum((run.radii**3).tolist()) for run in self.runs)
        return 4.0 / 3.0 * math.pi * cubes / len(self.runs) / self.plan.tray.volume

    @property
    def half_time(self) -> float | None:
        """When the mean speed has fallen to half, [s]; None when that is later than the end."""
        speed, times = self.mean('mean_speed'), self.plan.times
        half = 0.5 * speed[0]
        below = np.flatnonzero(speed <= half)
        if not below.size or half <= 0.0:
            return None
        k = int(below[0])
        part = (speed[k - 1] - half) / (speed[k - 1] - speed[k])
        return float(times[k - 1] + part * (times[k] - times[k - 1]))

    def provenance(self) -> str:
        """What made these runs, as JSON: version, settings, seed, tray; units are SI."""
        return json.dumps(self.plan.provenance(), sort_keys=True)
