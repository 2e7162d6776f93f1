"""Cluster size from the width of an autocorrelation, by a curve from simulated images.

The area in which the autocorrelation exceeds a level depends on the camera as much as on the
clusters: shadows and blur alone enlarge it by up to half. They widen the peak at every level by
the same factor, so that the *breadth*, the ratio of the area to that at a higher level, hardly
depends on them. The *reading* of an image is ln(breadth) + weight ln(area), with the weight that
separates sizes best for an unknown camera.

Two beads that touch or overlap in the image are one object to the autocorrelation, whether they
stick or not, and if all beads are connected its width is that of the tray. So the reading rises
slowly with ln(size). Its mean over many simulated images is a rising curve, and the scatter of
single images about it is the error of a size. The curve ends where that error exceeds a factor
of three.

Tested by ``test/inference/cluster_size/test_cluster_curve.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import UNKNOWN, Measured, SizeStatus

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A pixel darker than this fraction of the darkest pixel counts as covered.
DARKER = 0.15
# Level of the area that the level area is divided by.
INNER_LEVEL = 0.7
# Beads and the rest of their shadows cover 0.71 to 1.4 times the area of their discs. Below this
# ratio beads are missing, and the others would look like large clusters.
_COVER = 0.68
# Number of sizes on the grid for an interval.
_GRID = 400
# A camera as those of the calibration; its variation is in the scatter of the curve.
_NO_OFFSET = Measured(0.0, 0.0)


class Width(NamedTuple):
    """Width of the autocorrelation of an image, and contrast of the image.

    `level_area` and `inner_area`: areas above the level and above `INNER_LEVEL`, [m^2];
    `contrast`: standard deviation of the image, [gray levels]; `cover`: fraction of pixels darker
    than `DARKER` times the darkest pixel, NaN if unknown.
    """

    level_area: float
    inner_area: float
    contrast: float
    cover: float = UNKNOWN


class SizeEstimate(NamedTuple):
    """A weight-averaged cluster size, [beads]; NaN where unknown.

    `lower` and `upper`: sizes whose mean reading is within one standard deviation.
    """

    size: float
    error: float
    lower: float
    upper: float
    status: SizeStatus


@dataclass(frozen=True, kw_only=True, eq=False)
class ClusterCurve:
    """Mean reading of one tray as a rising function of ln(weight-averaged size).

    Parameters
    ----------
    tray : str
        Its `curve_key`.
    made_by : str
        JSON: version, seed, runs, level.
    level : float
        Of the autocorrelation.
    log_size : ndarray (n,)
        Rising from 0, to the largest simulated.
    reading : ndarray (n,)
        ln(breadth) + weight ln(level area / m^2), rising.
    scatter : ndarray (n,)
        Standard deviation of the reading of one image, over all cameras.
    end : int
        Number of nodes up to the last with a known size; 0 if the width does not depend on the
        size.
    weight : float, >= 0
    least : Width
        Smallest level area and contrast of beads.
    breadths : tuple of 2 floats
        Smallest and largest breadth of beads.
    discs : float
        Ratio of the disc area of all beads to the area of the floor.
    samples : ndarray of float32, (n_samples, 6)
        Simulated images: run, time since the shaking event [s], size, level area and inner
        area [m^2], contrast.
    """

    tray: str
    made_by: str
    level: float
    log_size: NDArray[np.float64]
    reading: NDArray[np.float64]
    scatter: NDArray[np.float64]
    end: int
    weight: float
    least: Width
    breadths: tuple[float, float]
    discs: float
    samples: NDArray[np.float32]

    @property
    def largest(self) -> float:
        """Weight-averaged size at the end of the curve, [beads]; NaN without a curve."""
        return math.exp(self.log_size[self.end - 1]) if self.end else UNKNOWN

    def size_of(self, width: Width) -> SizeEstimate:
        """Size at a width, never beyond the curve.

        Parameters
        ----------
        width : Width
        """
        if not self.end:
            return _unknown(SizeStatus.INSENSITIVE)
        if width.cover < _COVER * self.discs:
            return _unknown(SizeStatus.NOTHING)
        if not (
            width.level_area > self.least.level_area
            and width.contrast > self.least.contrast
            and self.breadths[0] * width.inner_area
            < width.level_area
            < self.breadths[1] * width.inner_area
        ):
            return _unknown(SizeStatus.NOTHING)
        return self.size_at(self.reading_of(width.level_area, width.level_area / width.inner_area))

    def reading_of(self, level_area: float, breadth: float) -> float:
        """Reading of an image.

        Parameters
        ----------
        level_area : float, [m^2]
        breadth : float
        """
        return math.log(breadth) + self.weight * math.log(level_area)

    def size_at(self, reading: float, offset: Measured = _NO_OFFSET) -> SizeEstimate:
        """Size at a reading, MEASURED or BEYOND.

        Parameters
        ----------
        reading : float
        offset : Measured
            Of the readings of this camera from those of the calibration.
        """
        read = reading - offset.value
        lower, upper = self._interval(read, offset.error)
        size = self._inverse(read)
        if math.isnan(size):
            return SizeEstimate(UNKNOWN, UNKNOWN, lower, upper, SizeStatus.BEYOND)
        return SizeEstimate(size, 0.5 * (upper - lower), lower, upper, SizeStatus.MEASURED)

    def excludes(self, reading: float, size: Measured) -> bool:
        """Whether a size of which something else is sure does not give such a reading.

        Two standard errors of the size and two standard deviations of the reading are allowed.

        Parameters
        ----------
        reading : float
        size : Measured, [beads]
            Unknown: nothing is excluded.
        """
        if not size.known:
            return False
        limits = (max(size.value + sign * 2.0 * size.error, 1.0) for sign in (-1.0, 1.0))
        lower, upper = (
            float(
                np.interp(math.log(limit), self.log_size, self.reading)
                + sign * 2.0 * np.interp(math.log(limit), self.log_size, self.scatter)
            )
            for sign, limit in zip((-1.0, 1.0), limits, strict=True)
        )
        return not lower <= reading <= upper

    def _interval(self, read: float, error: float) -> tuple[float, float]:
        """Smallest and largest size whose mean reading is within one standard deviation.

        The scatter of the calibration and the error of the offset add up.

        All simulated sizes count, also those beyond the end: where the curve is flat, an image
        with the reading of ten beads may show a cluster of all beads.
        """
        near = min(max(read, self.reading[0]), self.reading[-1])
        log_size = np.linspace(0.0, self.log_size[-1], _GRID)
        reading = np.interp(log_size, self.log_size, self.reading)
        scatter = np.hypot(np.interp(log_size, self.log_size, self.scatter), error)
        inside = log_size[np.abs(near - reading) <= scatter]
        return math.exp(inside[0]), math.exp(inside[-1])

    def _inverse(self, read: float) -> float:
        """Size at a reading: 1, the smallest size, below the curve; NaN beyond its end."""
        if read > self.reading[self.end - 1]:
            return UNKNOWN
        return math.exp(float(np.interp(read, self.reading, self.log_size)))


def _unknown(status: SizeStatus) -> SizeEstimate:
    return SizeEstimate(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, status)
