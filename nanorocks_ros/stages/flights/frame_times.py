"""When pictures were taken, where that is not the time of their stamps.

Many cameras stamp pictures as they arrive, some milliseconds off. All beads in flight then seem to
be ahead of their lines, or behind them, by the same time. Beads collide one by one, and what moves
the picture, or accelerates the tray, displaces them alike, whatever their velocities: neither
looks like that. Drag bends all flights by the same time, but in all pictures.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.stable_sort import stable_argsort

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.records import Tracks

# Pictures on each side to which the lines of beads are fitted, and the part of the variance of
# their own times that comes back where the lines are compared.
_SIDE = 5
_SPAN = 2 * _SIDE + 1
_LEFT = 0.5 / _SIDE
_FEWEST_BEADS = 6
# Largest distance of a bead from its line, across it, in its errors: a bead that is struck, and
# most that were, are left out.
_ASTRAY = 4.0
# Times off are believed up to this part of the time between pictures: more is a lost picture.
_MOST = 0.45
# Pictures that are compared, and how far the square of their times off must exceed what errors of
# places explain: without any it was up to 4.2 times that in 112 simulated cycles.
_COMPARED, _FEWEST_COMPARED, _SHOWN = 120, 60, 5.0
# The scatter is renewed after so many more.
_RENEWED = 10
# Standard deviation of a normal variate over the median of its absolute values, and error of a
# median over that of the mean.
_DEVIATION, _MEDIAN_ERROR = 1.4826, 1.2533


class FrameTimes:
    """Corrects the times of pictures by the beads in flight, where they are off by chance.

    From then on each picture is held back until five more have come. Where the times of the stamps
    explain the flights nothing is held back and nothing corrected; what all pictures are off by is
    not seen.

    Attributes
    ----------
    scatter : float, [s]
        Standard deviation of the times off; 0 where none are seen.
    """

    def __init__(self) -> None:
        self._last: deque[tuple[float, Tracks]] = deque(maxlen=_SPAN)
        self._waiting = 0
        self._ids: NDArray[np.int32] = np.empty(0, dtype=np.int32)
        # Places in space, and their errors; NaN where a bead is not seen.
        self._paths = np.empty((_SPAN, 0, 3))
        # Times off, and their errors by those of the places.
        self._compared: deque[tuple[float, float]] = deque(maxlen=_COMPARED)
        self._until = _FEWEST_COMPARED
        self._usual = 0.0
        self.scatter = 0.0

    def push(self, time: float, tracks: Tracks) -> list[tuple[float, Tracks]]:
        """Take the next picture.

        Parameters
        ----------
        time : float, [s]
            Of its stamp.
        tracks : Tracks

        Returns
        -------
        list of (float, Tracks)
            The pictures that are not held back any more, with their times.
        """
        self._add(time, tracks)
        off, error = math.nan, math.nan
        if len(self._last) == _SPAN:
            off, error = self._time_off()
            if not math.isnan(off):
                self._compared.append((off, error))
                self._learn()
                off -= self._usual
        if not self.scatter:
            return [(time, tracks)]
        self._waiting += 1
        if self._waiting <= _SIDE:
            return []
        self._waiting -= 1
        time, tracks = self._last[-1 - _SIDE]
        return [(time + self._believed(off, error), tracks)]

    def flush(self) -> list[tuple[float, Tracks]]:
        """The pictures that are held back, with the times of their stamps."""
        held, self._waiting = list(self._last)[len(self._last) - self._waiting :], 0
        return held

    def _add(self, time: float, tracks: Tracks) -> None:
        self._last.append((time, tracks))
        if not np.array_equal(tracks.ids, self._ids):
            before = self._paths
            self._paths = np.full((_SPAN, tracks.ids.size, 3), np.nan)
            _, now, then = np.intersect1d(
                tracks.ids, self._ids, assume_unique=True, return_indices=True
            )
            self._paths[:, now] = before[:, then]
            self._ids = tracks.ids
        self._paths[:-1] = self._paths[1:]
        self._paths[-1, :, :2] = tracks.positions + tracks.displacement
        self._paths[-1, :, 2] = np.where(tracks.seen, tracks.position_errors, np.nan)

    def _time_off(self) -> tuple[float, float]:
        """By how much the middle picture is late, and the error; NaN where unknown."""
        times = np.array([time for time, _ in self._last])
        off, error = _time_off(self._paths, times - times[_SIDE])
        interval = (times[-1] - times[0]) / (_SPAN - 1)
        return (off, error) if abs(off) < _MOST * interval else (math.nan, math.nan)

    def _learn(self) -> None:
        """Learn the scatter of the times off; once they are seen they stay."""
        self._until -= 1
        if self._until > 0:
            return
        self._until = _RENEWED
        off, error = np.array(self._compared).T
        self._usual = float(np.median(off))
        found = _DEVIATION * float(np.median(np.abs(off - self._usual)))
        expected = float(np.median(error))
        # Where beads are slow they do not tell it.
        if found**2 > _SHOWN * expected**2:
            self.scatter = math.sqrt((found**2 - expected**2) / (1.0 + _LEFT))

    def _believed(self, off: float, error: float) -> float:
        """The likeliest time off."""
        variance = self.scatter**2
        gain = variance / ((1.0 + _LEFT) * variance + error**2)
        return 0.0 if math.isnan(off) else gain * off


@compiled
def _time_off(paths: NDArray[np.float64], times: NDArray[np.float64]) -> tuple[float, float]:
    """Median time by which beads in flight are ahead of their lines in the middle picture.

    What displaces all of them alike is taken out.

    Parameters
    ----------
    paths : ndarray (pictures, beads, 3), [m]
        Places and their errors.
    times : ndarray (pictures,), [s]
        After the middle picture.

    Returns
    -------
    float, float, [s]
        With its error by the scatter of the beads; NaN where too few tell it.
    """
    pictures, beads = paths.shape[0], paths.shape[1]
    middle = pictures // 2
    # A line through all pictures but the middle one, whose time is 0.
    since = times - times.sum() / (pictures - 1)
    shares, slopes = np.full(pictures, 1.0 / (pictures - 1)), since.copy()
    shares[middle] = slopes[middle] = 0.0
    slopes /= (slopes**2).sum()
    # Of beads in flight: their distances from the lines, velocities, and errors of their places.
    found, line = np.empty((5, beads)), np.empty(4)
    count = 0
    for bead in range(beads):
        for axis in range(2):
            line[axis] = line[2 + axis] = 0.0
            for k in range(pictures):
                line[axis] += shares[k] * paths[k, bead, axis]
                line[2 + axis] += slopes[k] * paths[k, bead, axis]
        if _is_straight(paths, bead, since, line):
            for axis in range(2):
                at = line[axis] + since[middle] * line[2 + axis]
                found[axis, count] = paths[middle, bead, axis] - at
                found[2 + axis, count] = line[2 + axis]
            found[4, count] = paths[middle, bead, 2]
            count += 1
    if count < _FEWEST_BEADS:
        return math.nan, math.nan
    alike = np.ones(count)
    for axis in range(4):
        # What displaces all of them alike.
        found[axis, :count] -= _weighted_median(found[axis, :count], alike)
    late, weight = np.empty(count), np.empty(count)
    for bead in range(count):
        square = found[2, bead] ** 2 + found[3, bead] ** 2
        along = found[0, bead] * found[2, bead] + found[1, bead] * found[3, bead]
        # One as fast as the median tells nothing.
        late[bead] = along / square if square > 0.0 else 0.0
        weight[bead] = math.sqrt(square) / found[4, bead]
    median = _weighted_median(late, weight)
    # Of few beads the medians are nearer to them than to the truth.
    scatter = _weighted_median(np.abs(late - median) * weight, alike) * math.sqrt(
        count / (count - 2.0)
    )
    return median, _MEDIAN_ERROR * _DEVIATION * scatter / math.sqrt((weight**2).sum())


@compiled
def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """The value below which half of the weights is."""
    median, below, half = 0.0, 0.0, 0.5 * weights.sum()
    for k in stable_argsort(values):
        if below < half:
            median = values[k]
        below += weights[k]
    return median


@compiled
def _is_straight(
    paths: NDArray[np.float64],
    bead: int,
    since: NDArray[np.float64],
    line: NDArray[np.float64],
) -> bool:
    """Whether a bead is on its line: place (2,) and velocity (2,)."""
    speed = math.hypot(line[2], line[3])
    straight = True
    for k in range(since.size):
        x = paths[k, bead, 0] - line[0] - since[k] * line[2]
        y = paths[k, bead, 1] - line[1] - since[k] * line[3]
        # Across its line a bead shows the errors of its places alone, whatever the times. Where
        # it is hidden they are NaN, which is below nothing.
        across = abs(line[2] * y - line[3] * x)
        straight = straight and across < _ASTRAY * paths[k, bead, 2] * speed
    return straight
