"""Width of the autocorrelation of a tray image, and the size of clusters from it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.cluster_size.cluster_curve import curve_of
from nanorocks_ros.inference.cluster_size.size_from_width import (
    DARKER,
    INNER_LEVEL,
    SizeEstimate,
    Width,
)
from nanorocks_ros.physics.autocorrelation import LevelRegion, autocorrelation, level_region
from nanorocks_ros.records import (
    NS,
    UNKNOWN,
    Autocorrelation,
    ClusterEstimate,
    MeasuredInterval,
    Notice,
    SizeStatus,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.clusters.background_removal import tray_contrast, tray_levels
from nanorocks_ros.stages.preprocess.shaking.shaking_cycles import CycleFollower
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve

# From this scale on, two by two pixels show as much of the clusters as one does, in a quarter of
# the time: then such a pixel is as large as one at half this scale. [px/m]
_FINE = 9000.0
Correlations = ClusterEstimate | Autocorrelation | Notice
SIZES_UNKNOWN = 'cluster sizes are unknown'
"""What every notice about a missing calibration says."""
_NO_SIZE = SizeEstimate(UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, SizeStatus.UNCALIBRATED)


class Correlated(NamedTuple):
    """The autocorrelation of the contrast of a tray image.

    `values`: ndarray of float32, 1 at zero lag, in the centre; `side` of its pixels, [m];
    `contrast`: standard deviation of the picture, [gray levels]; `cover`: share of its pixels
    that are clearly darker than the floor.
    """

    values: NDArray[np.float32]
    side: float
    contrast: float
    cover: float

    def region(self, level: float) -> LevelRegion:
        """The region around zero lag in which it exceeds a level."""
        return level_region(self.values, level)

    def width(self, level_area: float) -> Width:
        """The width, from a level area, [px^2]."""
        inner = level_region(self.values, INNER_LEVEL).area
        return Width(level_area * self.side**2, inner * self.side**2, self.contrast, self.cover)


def correlated(gray: NDArray[np.uint8], pixels_per_metre: float) -> Correlated:
    """Correlate the contrast of a tray image.

    Parameters
    ----------
    gray : ndarray of uint8, (rows, columns)
    pixels_per_metre : float
        Fine images are taken at half their resolution.
    """
    halve = _halves(gray, pixels_per_metre)
    return _correlated(tray_contrast(gray, halve=halve), pixels_per_metre, halve=halve)


def correlated_with_shadows(gray: NDArray[np.uint8], pixels_per_metre: float) -> Correlated:
    """Correlate the levels of a tray image, with its shadows, for methods that keep the floor.

    Parameters
    ----------
    gray, pixels_per_metre
        As for `correlated`.
    """
    halve = _halves(gray, pixels_per_metre)
    return _correlated(tray_levels(gray, halve=halve), pixels_per_metre, halve=halve)


def _halves(gray: NDArray[np.uint8], pixels_per_metre: float) -> bool:
    return pixels_per_metre >= _FINE and min(gray.shape) > 1


def _correlated(
    contrast: NDArray[np.float32], pixels_per_metre: float, *, halve: bool
) -> Correlated:
    side = (2.0 if halve else 1.0) / pixels_per_metre
    cover = float(np.count_nonzero(contrast < DARKER * contrast.min())) / contrast.size
    return Correlated(autocorrelation(contrast), side, float(contrast.std()), cover)


class ClusterAutocorrelator(RestartingStage[TrayImage, Correlations]):
    """Measures the width of the autocorrelation of the images of one tray.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    curve : ClusterCurve or None
        Calibration of this tray.
    emit_image : bool
        Also emit each :class:`Autocorrelation`; off by default.

    Raises
    ------
    ConfigurationError
        For a calibration file that cannot be read, or has no curve of this tray.
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings
        self._tray = tray
        self.curve, self._notice = _curve(settings, tray)
        self.emit_image = False
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        del stamp_ns
        speed = self._settings.speed
        self._cycles = CycleFollower(speed.shake_ratio, speed.min_cycle_duration)
        self._next_ns: int | None = None

    def _process(self, record: TrayImage) -> tuple[Correlations, ...]:
        return self._correlations(self._cycles.push(record))

    def flush(self) -> tuple[Correlations, ...]:
        """Of the images that were held back until their cycle was known."""
        return self._correlations(self._cycles.flush())

    def _correlations(self, images: Iterable[TrayImage]) -> tuple[Correlations, ...]:
        return tuple(record for image in images for record in self._correlation(image))

    def _correlation(self, image: TrayImage) -> tuple[Correlations, ...]:
        if self._next_ns is not None and image.stamp_ns < self._next_ns:
            return ()
        self._next_ns = image.stamp_ns + round(self._settings.clusters.interval * NS)
        records: list[Correlations] = []
        correlation = correlated(image.gray, self._settings.preprocess.pixels_per_metre)
        records.append(self._estimate(image, correlation))
        if self.emit_image:
            picture = Autocorrelation(
                stamp_ns=image.stamp_ns, tray=image.tray, values=correlation.values
            )
            records.append(picture)
        if self._notice:
            records.append(Notice(stamp_ns=image.stamp_ns, text=self._notice))
            self._notice = ''
        return tuple(records)

    def _estimate(self, image: TrayImage, correlation: Correlated) -> ClusterEstimate:
        region = correlation.region(self._settings.clusters.level)
        width = correlation.width(region.area)
        size = _NO_SIZE if self.curve is None else self.curve.size_of(width)
        area, inner = width.level_area, width.inner_area
        return ClusterEstimate(
            stamp_ns=image.stamp_ns,
            tray=self._tray.number,
            cycle=image.cycle or 0,
            level_area=area,
            correlation_length=math.sqrt(area / math.pi),
            axes_ratio=region.axes_ratio,
            direction=region.direction,
            breadth=area / inner if inner > 0.0 else UNKNOWN,
            cluster_size=MeasuredInterval(size.size, size.error, size.lower, size.upper),
            size_status=size.status,
        )


def _curve(settings: PipelineSettings, tray: Tray) -> tuple[ClusterCurve | None, str]:
    """The calibration curve, or None and the reason."""
    try:
        curve = curve_of(tray, settings.clusters.curve)
    except ConfigurationError as error:
        # Speeds and restitutions do not need the curve; a file named in the settings is required.
        if settings.clusters.curve:
            raise
        return None, f'{error}; until then {SIZES_UNKNOWN}'
    level, mix = settings.clusters.level, settings.preprocess.gray_mix
    if level != curve.level or mix != PipelineSettings().preprocess.gray_mix:
        return None, (
            f'tray {tray.number}: {SIZES_UNKNOWN}: they are calibrated for '
            f'clusters.level {curve.level:g} and the default preprocess.gray_mix'
        )
    return curve, ''
