"""From the width of an autocorrelation to the size of the clusters, by simulated ones.

The area in which the autocorrelation exceeds a level depends on the camera as much as on the
clusters: shadows and blur alone make it up to half as large again. They widen the peak at every
level alike, though, so that the *breadth*, the area over the one at a higher level, hardly depends
on them. What is *read* from a picture is ln(breadth) + weight ln(area), with the weight that tells
sizes best where nothing is known of the camera.

Where two beads touch or lie over each other in the picture they are one object to the
autocorrelation, whether they stick or not, and where all beads hang together its width is that of
the tray. So the reading rises slowly with ln(size), its mean over many simulated pictures is held
as a rising curve, and what single pictures scatter about it is the error of a size. A curve ends
where that error grows beyond a factor of three: there the width says nothing more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.records import UNKNOWN, SizeStatus

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Part of the contrast of the darkest pixel from which on a pixel counts as covered.
DARKER = 0.15
# Level of the area that the level area is divided by.
INNER_LEVEL = 0.7
# Beads and what is left of their shadows cover 0.71 to 1.4 times the area of their discs; with
# less to see than this, beads are missing, and those left would seem to be large clusters.
_COVER = 0.68
# Sizes that are tried for an interval.
_GRID = 400


class Width(NamedTuple):
    """How wide the autocorrelation of a picture is, and the contrast of the picture.

    `level_area` and `inner_area`: where it exceeds the level and `INNER_LEVEL`, [m^2]; `contrast`:
    standard deviation of the picture, [gray levels]; `cover`: share of it that is darker than
    `DARKER` of its darkest pixel, NaN when it is not known.
    """

    level_area: float
    inner_area: float
    contrast: float
    cover: float = UNKNOWN


class SizeEstimate(NamedTuple):
    """A weight-averaged cluster size, [beads]; NaN where it is not known.

    `lower` and `upper`: sizes between which the width is one standard deviation off or less.
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
        What is seen of a tray, see `curve_key`.
    made_by : str
        JSON: version, seed, runs, level.
    level : float
        Of the autocorrelation.
    log_size : ndarray (n,)
        Rising from 0, to the largest simulated.
    reading : ndarray (n,)
        ln(breadth) + weight ln(level area / m^2), rising.
    scatter : ndarray (n,)
        Standard deviation of the reading of one picture, whatever the camera does.
    end : int
        Points up to the last whose size can be told; 0 where the width says nothing of the size.
    weight : float, >= 0
    least : Width
        Less is not of beads, of level area or of contrast.
    breadths : tuple of 2 floats
        Less or more is not of beads.
    discs : float
        Area of the discs of all beads, over that of the floor.
    samples : ndarray of float32, (n_samples, 6)
        What it was made from: run, time since the shaking event [s], size, level area and inner
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
        """Weight-averaged size at which the curve ends, [beads]; NaN when there is none."""
        return math.exp(self.log_size[self.end - 1]) if self.end else UNKNOWN

    def size_of(self, width: Width) -> SizeEstimate:
        """The size that goes with a width, never beyond the curve.

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
        read = math.log(width.level_area / width.inner_area)
        read += self.weight * math.log(width.level_area)
        lower, upper = self._interval(read)
        size = self._inverse(read)
        if math.isnan(size):
            return SizeEstimate(UNKNOWN, UNKNOWN, lower, upper, SizeStatus.BEYOND)
        return SizeEstimate(size, 0.5 * (upper - lower), lower, upper, SizeStatus.MEASURED)

    def _interval(self, read: float) -> tuple[float, float]:
        """Least and largest size of which a reading is one standard deviation off or less.

        All sizes that were simulated count, those beyond the end too: where the curve is flat,
        what reads like ten beads may be all there are.
        """
        near = min(max(read, self.reading[0]), self.reading[-1])
        log_size = np.linspace(0.0, self.log_size[-1], _GRID)
        reading = np.interp(log_size, self.log_size, self.reading)
        scatter = np.interp(log_size, self.log_size, self.scatter)
        inside = log_size[np.abs(near - reading) <= scatter]
        return math.exp(inside[0]), math.exp(inside[-1])

    def _inverse(self, read: float) -> float:
        """Size at a reading: 1, the smallest there is, below the curve; NaN beyond its end."""
        if read > self.reading[self.end - 1]:
            return UNKNOWN
        return math.exp(float(np.interp(read, self.reading, self.log_size)))


def _unknown(status: SizeStatus) -> SizeEstimate:
    return SizeEstimate(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, status)
