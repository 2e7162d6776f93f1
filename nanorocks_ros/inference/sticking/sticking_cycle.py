"""Input of the sticking-speed inference: merges and speeds of one cycle.

Tested by ``test/inference/sticking/test_sticking_speed.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Merge

_NS = 1e9


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
    bounces : ndarray (k,)
        Log likelihood of each of `bounce_tables.SPEEDS` by the collisions of free beads that did
        not stick; empty where they are not known.
    """

    times: NDArray[np.float64]
    speeds: NDArray[np.float64]
    bodies: NDArray[np.float64]
    merges: NDArray[np.float64]
    bounces: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))


def sticking_cycle(
    beads: int,
    merges: Sequence[Merge],
    stamps_ns: NDArray[np.int64],
    speeds: NDArray[np.float64],
    start_ns: int,
) -> StickingCycle:
    """Cycle from the merges of a `BodyCounter` and the speeds of the beads.

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
    """
    end = (int(stamps_ns[-1]) - start_ns) / _NS
    merge_times = sorted((merge.stamp_ns - start_ns) / _NS for merge in merges if merge.joins)
    inside = np.array([max(time, 0.0) for time in merge_times if time <= end])
    sample_times = np.concatenate([[0.0], (stamps_ns - start_ns) / _NS])
    # The number of bodies is constant between merges: the values just before and after each
    # merge are nodes of the integral.
    times = np.sort(np.concatenate([sample_times, inside, np.nextafter(inside, np.inf)]))
    merged = np.searchsorted(inside, times, side='left')
    return StickingCycle(
        times=times,
        speeds=np.interp(times, sample_times[1:], speeds),
        bodies=beads - merged.astype(np.float64),
        merges=inside,
    )
