"""Width of the autocorrelation of a tray image, which grows when beads cluster."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from nanorocks_ros.records import Autocorrelation, ClusterEstimate, TrayImage
from nanorocks_ros.stages.shaking import NS, CycleFollower

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Tray


def autocorrelation(gray: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Normalised linear autocorrelation of an image about its mean.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)

    Returns
    -------
    ndarray of float32, (rows, columns)
        1 at zero lag, which lies at (rows // 2, columns // 2); all 0 for a uniform image.
    """
    rows, columns = gray.shape
    deviation = gray.astype(np.float32)
    deviation -= deviation.mean()
    # Padded, so that at the lags that are wanted, up to half of the size, the image is not
    # compared with its own repetition. Rows that are all zero, or not wanted, are not transformed.
    down, right = (fft.next_fast_len(size + size // 2 + 1, real=True) for size in (rows, columns))
    spectrum = fft.fft(fft.rfft(deviation, n=right, axis=1), n=down, axis=0)
    power = spectrum.real**2 + spectrum.imag**2
    along = fft.ifft(power, axis=0)[_lags(rows)]
    covariance = fft.irfft(along, n=right, axis=1)[:, _lags(columns)]
    variance = covariance[rows // 2, columns // 2]
    if variance <= 0.0:
        return np.zeros((rows, columns), dtype=np.float32)
    return np.ascontiguousarray(covariance / variance, dtype=np.float32)


def _lags(size: int) -> NDArray[np.int64]:
    """Shifts of an image against itself, zero in the middle."""
    return np.arange(size) - size // 2


class ClusterAutocorrelator:
    """Follows the width of the autocorrelation of one tray.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_image : bool
        Also emit each :class:`Autocorrelation`; off by default since few look at it.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.emit_image = False
        self._restart()

    def _restart(self) -> None:
        speed = self._settings.speed
        self._shakes = CycleFollower(speed.shake_ratio, speed.shortest_cycle)
        self._last_stamp_ns: int | None = None
        self._next_ns: int | None = None

    def push(self, image: TrayImage) -> tuple[ClusterEstimate | Autocorrelation, ...]:
        """Take the next image of the tray; empty between two intervals."""
        if self._last_stamp_ns is not None and image.stamp_ns <= self._last_stamp_ns:
            self._restart()
        self._last_stamp_ns = image.stamp_ns
        self._shakes.push(image)
        if self._next_ns is not None and image.stamp_ns < self._next_ns:
            return ()
        self._next_ns = image.stamp_ns + round(self._settings.clusters.interval * NS)
        values = autocorrelation(image.gray)
        estimate = self._estimate(image.stamp_ns, values)
        if not self.emit_image:
            return (estimate,)
        picture = Autocorrelation(stamp_ns=image.stamp_ns, tray=image.tray, values=values)
        return (estimate, picture)

    def _estimate(self, stamp_ns: int, values: NDArray[np.float32]) -> ClusterEstimate:
        pixels = np.count_nonzero(values > self._settings.clusters.level)
        area = float(pixels) / self._settings.preprocess.pixels_per_metre**2
        return ClusterEstimate(
            stamp_ns=stamp_ns,
            tray=self._tray.number,
            cycle=self._shakes.cycle,
            level_area=area,
            correlation_length=math.sqrt(area / math.pi),
        )
