"""Offset of a film's autocorrelations from those of the calibration, from single beads.

The curve of cluster sizes holds for the cameras of its simulated films. Beads that are drawn or
lit in another way make each autocorrelation wider or narrower by a factor, which is an offset of
the reading. It shows while all beads are single, which the tracks say: then the reading should be
the first one of the curve.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import NS, Measured

if TYPE_CHECKING:
    from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve

# Readings are learned so long after a shaking event. Tracks need some millimetres of path to see
# that beads stick, and may miss it. Soon after the event clusters have not grown yet, and
# fast beads show other arrangements in each picture.
_LEARNED_NS = 3 * NS
# Readings that are kept, those of about 13 cycles; light and focus change over a campaign.
_KEPT = 200
# Larger clusters share 0.8 of the offset of single beads, with a scatter of 0.3 between trays and
# sizes (`python -m benchmarks autocorrelation`).
_NOT_SHARED = 0.3


class _Reading(NamedTuple):
    cycle: int
    stamp_ns: int
    offset: float


class ReadingOffset:
    """Learns the offset of the readings of one tray; knows only instants up to the last.

    Parameters
    ----------
    curve : ClusterCurve
        Calibration of the tray.

    Attributes
    ----------
    curve : ClusterCurve
    """

    def __init__(self, curve: ClusterCurve) -> None:
        self.curve = curve
        self._readings: deque[_Reading] = deque(maxlen=_KEPT)
        self._cycle: int | None = None
        self._start_ns: int | None = None

    def follow(self, cycle: int, stamp_ns: int) -> None:
        """Take the cycle and stamp of the next image, whatever it shows.

        Of a cycle that was under way before the first image the start is not known.
        """
        if cycle != self._cycle:
            self._start_ns = None if self._cycle is None else stamp_ns
            self._cycle = cycle

    def learn(self, reading: float, stamp_ns: int) -> None:
        """Take the reading of an image of the cycle followed, in which all beads are single.

        Images before the first shaking event, and long after one, teach nothing.
        """
        if self._cycle is None or self._start_ns is None:
            return
        if stamp_ns - self._start_ns <= _LEARNED_NS:
            offset = reading - float(self.curve.reading[0])
            self._readings.append(_Reading(self._cycle, stamp_ns, offset))

    def forget(self, cycle: int, since_ns: int) -> None:
        """Drop the readings of a cycle from its first merge on, which became known later."""
        while self._readings:
            last = self._readings[-1]
            if last.cycle != cycle or last.stamp_ns < since_ns:
                return
            self._readings.pop()

    def known(self) -> Measured | None:
        """The offset with its error; None while no image of single beads was seen.

        Images that follow each other show much the same arrangement. So the error of the mean is
        the scatter of the images, not divided by the root of their number; one image has that of
        the calibration.
        """
        if not self._readings:
            return None
        offsets = np.array([reading.offset for reading in self._readings])
        mean = float(offsets.mean())
        squares = float(self.curve.scatter[0]) ** 2 + float(((offsets - mean) ** 2).sum())
        error = np.hypot(np.sqrt(squares / offsets.size), _NOT_SHARED * mean)
        return Measured(mean, float(error))

    def certainly_single(self, weighted_size: Measured) -> bool:
        """Whether the tracks say that all beads are single, and the width would not show more.

        Parameters
        ----------
        weighted_size : Measured, [beads]
            Its error holds pairs that may stick.
        """
        curve = self.curve
        largest = np.log(weighted_size.value + weighted_size.error)
        if not (weighted_size.value == 1.0 and np.isfinite(largest)):
            return False
        wider = np.interp(largest, curve.log_size, curve.reading) - curve.reading[0]
        return bool(wider <= curve.scatter[0])
