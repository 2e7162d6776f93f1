"""Speeds of the tracked beads over time, in bins.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.outputs.tables.table_columns import Column

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

_NS = 1e9
_BINS = 200
_LEAST_FRAMES = 3
# Part of the film at each end whose speeds are told.
_END = 0.05
SPEED_COLUMNS = (
    Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
    Column(name='time', unit='s', doc='middle of the bin, since the first frame'),
    Column(name='mean_speed', unit='m/s', doc='mean projected speed of the beads'),
    Column(name='rms_speed', unit='m/s', doc='root mean square of the projected speed'),
    Column(name='beads', unit='1', doc='mean number of beads with a known speed'),
)
"""Columns of the table of a tray."""


class TrackSpeeds(NamedTuple):
    """Projected speeds in bins of time.

    Parameters
    ----------
    time : ndarray (n,), [s]
        Middle of each bin, since the first frame.
    mean, rms : ndarray (n,), [m/s]
        NaN where no speed is known.
    beads : ndarray (n,)
        Mean number of beads with a known speed.
    """

    time: NDArray[np.float64]
    mean: NDArray[np.float64]
    rms: NDArray[np.float64]
    beads: NDArray[np.float64]

    @property
    def ends(self) -> tuple[float, float]:
        """Mean speed in the first and in the last twentieth of the film, [m/s]."""
        known = self.mean[np.isfinite(self.mean)]
        if not known.size:
            return math.nan, math.nan
        part = max(1, round(_END * known.size))
        return float(known[:part].mean()), float(known[-part:].mean())

    @property
    def highest(self) -> float:
        """The highest mean speed of a bin, [m/s]."""
        known = self.mean[np.isfinite(self.mean)]
        return float(known.max()) if known.size else math.nan


def track_speeds(tracks: Sequence[Tracks]) -> TrackSpeeds:
    """Mean and rms speed of all beads that are seen, with a bin for some frames each."""
    width = max(_LEAST_FRAMES, math.ceil(len(tracks) / _BINS))
    rows = [_bin(tracks[k : k + width], tracks[0].stamp_ns) for k in range(0, len(tracks), width)]
    return TrackSpeeds(*np.array(rows, dtype=np.float64).reshape(-1, 4).T)


def _bin(tracks: Sequence[Tracks], first_ns: int) -> tuple[float, float, float, float]:
    speeds = np.concatenate([np.hypot(*record.velocities[record.seen].T) for record in tracks])
    speeds = speeds[np.isfinite(speeds)]
    time = 0.5 * (tracks[0].stamp_ns + tracks[-1].stamp_ns - 2 * first_ns) / _NS
    if not speeds.size:
        return time, math.nan, math.nan, 0.0
    rms = math.sqrt(float(np.mean(speeds**2)))
    return time, float(speeds.mean()), rms, speeds.size / len(tracks)
