"""One cycle as the inference of the sticking speed needs it: merges of bodies, and speeds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Merge

_NS = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class StickingCycle:
    """Merges of the bodies of a cycle, and how fast the beads were.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Rising; merges are looked for from the first to the last.
    speeds : ndarray (n,), [m/s]
        Mean projected speed of the beads.
    bodies : ndarray (n,)
        Free bodies.
    merges : ndarray (m,), [s]
        Times at which bodies merged.
    """

    times: NDArray[np.float64]
    speeds: NDArray[np.float64]
    bodies: NDArray[np.float64]
    merges: NDArray[np.float64]


def sticking_cycle(
    beads: int,
    merges: Sequence[Merge],
    stamps_ns: NDArray[np.int64],
    speeds: NDArray[np.float64],
    start_ns: int,
) -> StickingCycle:
    """What a `BodyCounter` found in a cycle, with speeds of the beads.

    Parameters
    ----------
    beads : int
        In the tray.
    merges : sequence of Merge
    stamps_ns : ndarray of int64, (n,), [ns]
        Of the speeds, rising. Nothing is asked of later times.
    speeds : ndarray (n,), [m/s]
    start_ns : int, [ns]
        The shaking event: until the first speed they are taken to be that.
    """
    end = (int(stamps_ns[-1]) - start_ns) / _NS
    merge_times = sorted((merge.stamp_ns - start_ns) / _NS for merge in merges if merge.joins)
    inside = np.array([max(time, 0.0) for time in merge_times if time <= end])
    known = np.concatenate([[0.0], (stamps_ns - start_ns) / _NS])
    # Bodies are constant between merges: both values of each are nodes of the integral.
    times = np.sort(np.concatenate([known, inside, np.nextafter(inside, np.inf)]))
    merged = np.searchsorted(inside, times, side='left')
    return StickingCycle(
        times=times,
        speeds=np.interp(times, known[1:], speeds),
        bodies=beads - merged.astype(np.float64),
        merges=inside,
    )
