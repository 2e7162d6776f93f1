"""Input of the sticking-speed inference: merges and speeds of one cycle.

Tested by ``test/inference/sticking/test_sticking_speed.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Merge

_NS = 1e9
# Part of the merges that are known within the path that is left to the end.
_MOST = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingCycle:
    """Merges of the bodies of a cycle, and the speeds of the beads.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Rising; merges are counted from the first to the last.
    speeds : ndarray (n,), [m/s]
        Mean projected speed of the beads.
    bodies : ndarray (n,)
        Free bodies.
    merges : ndarray (m,), [s]
        Times at which bodies merged.
    undecided : float
        Merges that may have gone unseen in a cycle without any.
    bounces : ndarray (k,)
        Log likelihood of each of `bounce_tables.SPEEDS` by the collisions of free beads that did
        not stick; empty where they are not known.
    """

    times: NDArray[np.float64]
    speeds: NDArray[np.float64]
    bodies: NDArray[np.float64]
    merges: NDArray[np.float64]
    undecided: float = 0.0
    bounces: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


def sticking_cycle(
    beads: int,
    merges: Sequence[Merge],
    stamps_ns: NDArray[np.int64],
    speeds: NDArray[np.float64],
    start_ns: int,
    *,
    first_merge_path: float = 0.0,
) -> StickingCycle:
    """Cycle from the merges of a `BodyCounter` and the speeds of the beads.

    It ends where later merges are not known yet: a merge is known once free beads would have
    parted, which takes a path, not a time: the slower the gas, the longer. Of merges with a
    shorter path to the end many are missing: as bodies that did not merge they would speak for too
    low a sticking speed. The first merge always counts.

    Parameters
    ----------
    beads : int
        In the tray.
    merges : sequence of Merge
    stamps_ns : ndarray of int64, (n,), [ns]
        Of the speeds, rising. Later merges are ignored.
    speeds : ndarray (n,), [m/s]
    start_ns : int, [ns]
        The shaking event; the speed is constant from there to the first stamp.
    first_merge_path : float, [m]
        From `chance_proximity.first_merge_path`, where there is no merge; else the path is that in
        which the merges of the cycle became known.
    """
    end = (int(stamps_ns[-1]) - start_ns) / _NS
    merge_times = sorted((merge.stamp_ns - start_ns) / _NS for merge in merges if merge.joins)
    inside = np.array([max(time, 0.0) for time in merge_times if time <= end])
    sample_times = np.concatenate([[0.0], (stamps_ns - start_ns) / _NS])
    # The number of bodies is constant between merges: the values just before and after each
    # merge are nodes of the integral.
    times = np.sort(np.concatenate([sample_times, inside, np.nextafter(inside, np.inf)]))
    merged = np.searchsorted(inside, times, side='left')
    cycle = StickingCycle(
        times=times,
        speeds=np.interp(times, sample_times[1:], speeds),
        bodies=beads - merged.astype(np.float64),
        merges=inside,
    )
    known = [
        ((merge.stamp_ns - start_ns) / _NS, (merge.known_ns - start_ns) / _NS)
        for merge in merges
        if merge.joins and (merge.stamp_ns - start_ns) / _NS <= end
    ]
    # Trapezoidal rule.
    steps = 0.5 * (cycle.speeds[1:] + cycle.speeds[:-1]) * np.diff(cycle.times)
    path = np.append(0.0, np.cumsum(steps))
    needed, first = first_merge_path, cycle.times[0]
    if known:
        began, ended = (np.interp(times, cycle.times, path) for times in np.array(known).T)
        needed, first = float(np.quantile(ended - began, _MOST)), cycle.merges[0]
    return _up_to_path(cycle, path, path[-1] - needed, first)


def _up_to_path(
    cycle: StickingCycle, path: NDArray[np.float64], longest: float, first: float
) -> StickingCycle:
    """The part of a cycle up to a path of the beads, (n,), and at least up to a first time."""
    shows = (path <= longest) | (cycle.times <= first)
    last = cycle.times[shows][-1]
    return replace(
        cycle,
        times=cycle.times[shows],
        speeds=cycle.speeds[shows],
        bodies=cycle.bodies[shows],
        merges=cycle.merges[cycle.merges <= last],
    )
