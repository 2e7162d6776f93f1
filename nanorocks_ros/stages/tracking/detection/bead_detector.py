"""Detection of the beads in one image of a tray: species, position and radius, with errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.detection.background_model import (
    initial_background,
    update_background,
)
from nanorocks_ros.stages.tracking.detection.bead_edges import CURVATURES, RAYS
from nanorocks_ros.stages.tracking.detection.circle_fit import refit_circles
from nanorocks_ros.stages.tracking.detection.disc_scores import DiscSearch
from nanorocks_ros.stages.tracking.detection.floor_coverage import FloorCoverage
from nanorocks_ros.stages.tracking.detection.gray_threshold import GrayThreshold, covered_share
from nanorocks_ros.stages.tracking.detection.greedy_disc_cover import cover_with_discs
from nanorocks_ros.stages.tracking.detection.outline_profiles import OutlineProfiles
from nanorocks_ros.stages.tracking.detection.pixel_classes import (
    BLUE,
    GRAY,
    RED,
    PixelMaps,
    brighten_dark_hues,
    classify_chalky_pixels,
    classify_pixels,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import TrackingSettings

_HUE_SIGN = {RED: 1.0, BLUE: -1.0, GRAY: 0.0}
# Largest ratio of successive trial radii.
_RADIUS_FACTOR = 1.2
# Squares of the candidate grid per radius of the smallest bead.
_SQUARES_PER_RADIUS = 2.4
# Smallest radius for a candidate grid of two pixels, [px].
_COARSE_RADIUS_PX = 3.0
# Smallest prior spread of a radius, for species of one size, [px].
_RADIUS_SPREAD_PX = 0.3
# More beads than expected are searched, so that a wrong number is noticed.
_MAX_COUNT_FACTOR = 1.2
# Weight of a background pixel under a disc, over one of the species; 1 under chalk, and for
# grains, whose corners and few trial radii leave much floor under a disc.
_BACKGROUND_WEIGHT = 2
# The same for gray grains: they are many, and fewer radii are tried.
_GRAY_RADIUS_FACTOR = 1.45
# Smallest share of the outline of a gray bead with an edge, which shadows have not: 4 of the 16
# rays of a small one, since any three edges fit a circle.
_MIN_GRAY_OUTLINE = 0.2
# Darkness of no pixel, [%].
_NO_GRAY_PERCENT = 100
# Smallest visible share of a bead under chalk, if radii differ by more than the factor.
_MIN_CHALKY_SHARE, _WIDE_SIZE_RANGE = 0.45, 1.5
# Smallest relative change of the light that is applied to the whole background.
_MIN_LIGHT_CHANGE = 0.012
# Width of the filter that smooths patches of chalk, [px].
_CHALKY_BLUR_PX = 5
# Smallest step at the edge of a bead and largest level outside, of 255: of darkness, where a
# shadow may be another bead, and of coverage, where the floor shows in a shadow of 60 %.
_DARKNESS_LEVELS, _COVERAGE_LEVELS = (60.0, 80.0), (60.0, 150.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Detections:
    """Beads of one species in one frame.

    Parameters
    ----------
    positions : ndarray (n, 2), [px]
        Column and row; the centre of the first pixel is at (0.5, 0.5).
    position_errors : ndarray (n,), [px]
        Error of a coordinate.
    radii, radius_errors : ndarray (n,), [px]
    visible_outline, visible_share : ndarray (n,)
        Visible shares of the outline and of the disc.
    """

    positions: NDArray[np.float64]
    position_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    visible_outline: NDArray[np.float64]
    visible_share: NDArray[np.float64]


class BeadDetector:
    """Finds the beads of one tray.

    Parameters
    ----------
    settings : TrackingSettings
    tray : Tray
    pixels_per_metre : float, [px/m]
    """

    def __init__(self, settings: TrackingSettings, tray: Tray, pixels_per_metre: float) -> None:
        self._settings = settings
        self._has_gray = any(_class_of(species) == GRAY for species in tray.species)
        self._chalky = tray.chalk and not self._has_gray
        self._searches = [
            self._search_parameters(tray, species, pixels_per_metre) for species in tray.species
        ]
        self._coverages = [
            None
            if self._chalky or _class_of(species) == GRAY
            else FloorCoverage(_class_of(species), species.properties.color)
            for species in tray.species
        ]
        self._profiles = [OutlineProfiles() for _ in tray.species]
        gray = [species for species in tray.species if _class_of(species) == GRAY]
        # Grains in layers hide the floor: what they cover says nothing of their shadows.
        self._threshold = GrayThreshold(0.0 if self.crowded else covered_share(tray, gray))
        largest = max(species.diameter_high for species in tray.species)
        self._largest_diameter = max(3, round(largest * pixels_per_metre))
        self._frame = 0
        self._background: _Background | None = None

    @property
    def crowded(self) -> bool:
        """Whether a species has too many grains for detection."""
        return any(search.max_beads == 0 for search in self._searches)

    @property
    def darkness(self) -> NDArray[np.uint8] | None:
        """Darkness map of the last image: 0 background, 255 black; None before the first image."""
        return None if self._background is None else self._background.maps.darkness.copy()

    def detect(
        self, color: NDArray[np.uint8], hints: Sequence[NDArray[np.float64]] = ()
    ) -> tuple[Detections, ...]:
        """Detect the beads of each species, in the order of the species of the tray.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        hints : sequence of ndarrays (k, 4), [px]
            For each species the predicted beads: column, row, radius and its error.
        """
        color = np.ascontiguousarray(color)
        if self._background is None or self._background.mean.shape != color.shape:
            self._background = self._initial_background(color)
        maps = self._classify(color, self._background)
        own_maps = self._own_maps(color, self._background, maps)
        discs_and_fits = self._find_discs(
            own_maps, hints or [np.empty((0, 4))] * len(self._searches)
        )
        discs_of_all = np.concatenate([discs for discs, _ in discs_and_fits])
        detections = []
        first = 0
        for own, search, (discs, fits) in zip(
            own_maps, self._searches, discs_and_fits, strict=True
        ):
            end = first + len(discs)
            refit_circles(
                own, search.hue_sign, discs_of_all, first, len(discs), search.expected, fits
            )
            detections.append(_detections(discs_of_all[first:end], fits))
            first = end
        self._update_profiles(own_maps, discs_of_all, detections)
        self._threshold.update(maps.darkness, maps.pixel_class)
        self._update_background(color, maps, self._background)
        self._frame += 1
        return tuple(detections)

    def _initial_background(self, color: NDArray[np.uint8]) -> _Background:
        mean, confirmed = initial_background(color, self._has_gray, self._largest_diameter)
        shape = color.shape[:2]
        maps = PixelMaps(
            np.empty(shape, dtype=np.uint8),
            np.empty(shape, dtype=np.int16),
            np.empty(shape, dtype=np.uint8),
            np.zeros(shape, dtype=np.uint8),
            np.zeros((2, RAYS)),
            np.zeros((2, CURVATURES)),
            _DARKNESS_LEVELS,
        )
        return _Background(mean, _rounded(mean), confirmed, maps)

    def _classify(self, color: NDArray[np.uint8], background: _Background) -> PixelMaps:
        maps = background.maps
        percent = self._threshold.percent if self._has_gray else _NO_GRAY_PERCENT
        classify_pixels(color, background.levels, percent, maps)
        if self._chalky:
            brighten_dark_hues(color, maps.hue)
            smoothed = cv2.blur(maps.hue, (_CHALKY_BLUR_PX, _CHALKY_BLUR_PX))
            maps = maps._replace(hue=np.asarray(smoothed, dtype=np.int16))
            classify_chalky_pixels(background.levels, maps)
        maps.covered[:] = 0
        return maps

    def _own_maps(
        self, color: NDArray[np.uint8], background: _Background, maps: PixelMaps
    ) -> list[PixelMaps]:
        """The maps for each species: edges of a coloured bead are those of its coverage."""
        own = []
        # One lens sees all species.
        shared = max(self._profiles, key=lambda profiles: profiles.variance)
        for coverage, profiles in zip(self._coverages, self._profiles, strict=True):
            if coverage is None:
                edge_levels = maps.edge_levels if self._chalky else self._threshold.edge_levels
                own.append(maps._replace(edge_levels=edge_levels))
                continue
            coverage.update(color, maps.pixel_class)
            own.append(
                maps._replace(
                    darkness=coverage.map(color, background.levels, maps.darkness),
                    shifts=profiles.shifts,
                    biases=(profiles if profiles.variance else shared).biases,
                    edge_levels=_COVERAGE_LEVELS,
                )
            )
        return own

    def _update_profiles(
        self,
        own_maps: Sequence[PixelMaps],
        discs: NDArray[np.float64],
        detections: Sequence[Detections],
    ) -> None:
        first = 0
        for k, beads in enumerate(detections):
            if self._coverages[k] is not None:
                levels = own_maps[k].darkness
                self._profiles[k].update(levels, discs, first, beads.visible_outline)
            first += len(beads.radii)

    def _find_discs(
        self, maps: Sequence[PixelMaps], hints: Sequence[NDArray[np.float64]]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Find the discs of each species, with their fits."""
        discs_and_fits = [
            (np.zeros((search.max_beads, 3)), np.zeros((search.max_beads, 4)))
            for search in self._searches
        ]
        # Gray beads last: the outline of a coloured bead looks gray.
        for k in sorted(range(len(discs_and_fits)), key=lambda k: self._searches[k].kind == GRAY):
            discs, fits = discs_and_fits[k]
            count = cover_with_discs(maps[k], self._searches[k], hints[k], discs, fits)
            discs_and_fits[k] = discs[:count], fits[:count]
        return discs_and_fits

    def _update_background(
        self, color: NDArray[np.uint8], maps: PixelMaps, background: _Background
    ) -> None:
        gain = update_background(
            color,
            maps.covered,
            self._has_gray,
            self._frame,
            background.mean,
            background.levels,
            background.confirmed,
        )
        if abs(gain - 1.0) > _MIN_LIGHT_CHANGE and not (self._has_gray or self._chalky):
            # The row sets are too slow for a change of the light. Grains and chalk that look
            # like background would bias the gain.
            background.mean[:] *= np.float32(gain)
            background.levels[:] = _rounded(background.mean)

    def _search_parameters(
        self, tray: Tray, species: Species, pixels_per_metre: float
    ) -> DiscSearch:
        low = 0.5 * species.diameter_low * pixels_per_metre
        high = 0.5 * species.diameter_high * pixels_per_metre
        pixel_class = _class_of(species)
        factor = _GRAY_RADIUS_FACTOR if pixel_class == GRAY else _RADIUS_FACTOR
        n_sizes = max(1, int(np.ceil(np.log(high / low) / np.log(factor))))
        disc_area = 0.25 * np.pi * species.diameter**2 * species.count
        tray_area = tray.dimensions[0] * tray.dimensions[1]
        crowded = (
            pixel_class == GRAY and disc_area > self._settings.max_covered_fraction * tray_area
        )
        # Under chalk, the visible part of a large bead may look like a small bead.
        min_share = _MIN_CHALKY_SHARE if self._chalky and high > _WIDE_SIZE_RANGE * low else 0.0
        spread = max((high - low) / np.sqrt(12.0), _RADIUS_SPREAD_PX)
        return DiscSearch(
            kind=pixel_class,
            hue_sign=_HUE_SIGN[pixel_class],
            radii=np.geomspace(low, high, 2 * n_sizes + 1)[1::2].copy(),
            expected=np.array([0.5 * (low + high), spread]),
            step=max(2 if low >= _COARSE_RADIUS_PX else 1, int(low / _SQUARES_PER_RADIUS)),
            max_beads=0 if crowded else int(_MAX_COUNT_FACTOR * species.count) + 2,
            background_weight=1 if self._chalky or pixel_class == GRAY else _BACKGROUND_WEIGHT,
            min_share=max(self._settings.min_visible_fraction, min_share),
            min_outline=_MIN_GRAY_OUTLINE if pixel_class == GRAY else 0.0,
        )


class _Background(NamedTuple):
    """State of the background model, and the maps of the last image.

    `mean` and `levels` are (rows, columns, 3), as floats and rounded; `confirmed` is where it
    has been visible.
    """

    mean: NDArray[np.float32]
    levels: NDArray[np.uint8]
    confirmed: NDArray[np.bool_]
    maps: PixelMaps


def _class_of(species: Species) -> int:
    return {1: RED, -1: BLUE, 0: GRAY}[species.properties.hue]


def _rounded(mean: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.asarray(np.clip(mean + 0.5, 0.0, 255.0), dtype=np.uint8)


def _detections(discs: NDArray[np.float64], fits: NDArray[np.float64]) -> Detections:
    # Contiguous columns: numba compiles strided and contiguous arrays separately.
    errors, radius_errors, visible_outline, visible_share = np.ascontiguousarray(fits.T)
    return Detections(
        positions=discs[:, :2].copy(),
        position_errors=errors,
        radii=discs[:, 2].copy(),
        radius_errors=radius_errors,
        visible_outline=visible_outline,
        visible_share=visible_share,
    )
