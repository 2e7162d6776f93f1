"""Beads in one picture of a tray: species, place and size of each, with errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.detection.background_model import first_floor, renew_floor
from nanorocks_ros.stages.tracking.detection.circle_fit import refit
from nanorocks_ros.stages.tracking.detection.disc_scores import Search
from nanorocks_ros.stages.tracking.detection.greedy_disc_cover import cover
from nanorocks_ros.stages.tracking.detection.pixel_classes import (
    BLUE,
    GRAY,
    RED,
    Picture,
    lift_dark_hues,
    look_at_dusty_pixels,
    look_at_pixels,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import TrackingSettings

_HUE_SIGN = {RED: 1.0, BLUE: -1.0, GRAY: 0.0}
# Sizes tried differ by this factor at most.
_SIZE_STEP = 1.2
# Squares in which places are tried, per radius of the smallest bead.
_SQUARES_PER_RADIUS = 2.4
# Smallest radius with which squares of two pixels lose nothing, [px].
_COARSE_FROM_PX = 3.0
# What a size that all beads of a species share may still be off in the picture, [px].
_SIZE_SPREAD_PX = 0.3
# More beads than the tray should hold are looked for, so that a wrong number shows.
_SURPLUS = 1.2
# A pixel of floor under a disc outweighs so many of the species; not where chalk may hide them.
_FLOOR_WEIGHT = 2
# Gray grains are many: fewer sizes are tried.
_GRAY_SIZE_STEP = 1.45
# Least share of its disc that a bead under chalk must show where sizes differ by a factor.
_LEAST_SLIVER, _MANY_SIZES = 0.45, 1.5
# Of the light, a change that is followed at once.
_LIGHT_CHANGE = 0.012
# Patches of chalk are smoothed over so many pixels.
_DUSTY_BLUR_PX = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Detections:
    """Beads of one species in one picture.

    Parameters
    ----------
    places : ndarray (n, 2), [px]
        Column and row; the centre of the first pixel is at (0.5, 0.5).
    place_errors : ndarray (n,), [px]
        Of a coordinate.
    radii, radius_errors : ndarray (n,), [px]
    outline_seen, area_seen : ndarray (n,)
        Shares of the outline and of the disc that are not hidden.
    """

    places: NDArray[np.float64]
    place_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    outline_seen: NDArray[np.float64]
    area_seen: NDArray[np.float64]


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
        self._gray_known = any(_kind(one) == GRAY for one in tray.species)
        self._dusty = tray.chalk and not self._gray_known
        self._searches = [self._search(tray, one, pixels_per_metre) for one in tray.species]
        largest = max(one.diameter_high for one in tray.species)
        self._reach = max(3, round(largest * pixels_per_metre))
        self._turn = 0
        self._ground: _Ground | None = None

    @property
    def crowded(self) -> bool:
        """Whether there are too many grains to look for."""
        return any(search.most == 0 for search in self._searches)

    @property
    def darkness(self) -> NDArray[np.uint8] | None:
        """Of the last picture, where discs are looked for: 0 floor, 255 black; None before it."""
        return None if self._ground is None else self._ground.picture.darkness.copy()

    def detect(
        self, color: NDArray[np.uint8], hints: Sequence[NDArray[np.float64]] = ()
    ) -> tuple[Detections, ...]:
        """The beads of each species, in the order of the species of the tray.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        hints : sequence of ndarrays (k, 4), [px]
            For each species where beads should be: column, row, radius and its error.
        """
        color = np.ascontiguousarray(color)
        if self._ground is None or self._ground.floor.shape != color.shape:
            self._ground = self._first_ground(color)
        picture = self._look(color, self._ground)
        found = self._find(picture, hints or [np.empty((0, 4))] * len(self._searches))
        every = np.concatenate([discs for discs, _ in found])
        detections = []
        first = 0
        for search, (discs, fits) in zip(self._searches, found, strict=True):
            last = first + len(discs)
            refit(picture, search.hue_sign, every, first, len(discs), search.expected, fits)
            detections.append(_detections(every[first:last], fits))
            first = last
        self._renew(color, picture, self._ground)
        self._turn += 1
        return tuple(detections)

    def _first_ground(self, color: NDArray[np.uint8]) -> _Ground:
        floor, sure = first_floor(color, self._gray_known, self._reach)
        shape = color.shape[:2]
        picture = Picture(
            np.empty(shape, dtype=np.uint8),
            np.empty(shape, dtype=np.int16),
            np.empty(shape, dtype=np.uint8),
            np.zeros(shape, dtype=np.uint8),
        )
        return _Ground(floor, _rounded(floor), sure, picture)

    def _look(self, color: NDArray[np.uint8], ground: _Ground) -> Picture:
        picture = ground.picture
        look_at_pixels(color, ground.levels, self._gray_known, picture)
        if self._dusty:
            lift_dark_hues(color, picture.hue)
            smooth = cv2.blur(picture.hue, (_DUSTY_BLUR_PX, _DUSTY_BLUR_PX))
            picture = picture._replace(hue=np.asarray(smooth, dtype=np.int16))
            look_at_dusty_pixels(ground.levels, picture)
        picture.covered[:] = 0
        return picture

    def _find(
        self, picture: Picture, hints: Sequence[NDArray[np.float64]]
    ) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Discs and fits of each species."""
        found = [
            (np.zeros((search.most, 3)), np.zeros((search.most, 4))) for search in self._searches
        ]
        # Gray ones last: the outline of a coloured bead looks gray.
        for k in sorted(range(len(found)), key=lambda k: self._searches[k].kind == GRAY):
            discs, fits = found[k]
            count = cover(picture, self._searches[k], hints[k], discs, fits)
            found[k] = discs[:count], fits[:count]
        return found

    def _renew(self, color: NDArray[np.uint8], picture: Picture, ground: _Ground) -> None:
        gain = renew_floor(
            color,
            picture.covered,
            self._gray_known,
            self._turn,
            ground.floor,
            ground.levels,
            ground.sure,
        )
        if abs(gain - 1.0) > _LIGHT_CHANGE and not (self._gray_known or self._dusty):
            # The rows in turn are too slow for a light that changes everywhere. Grains and
            # chalk that pass for floor would lead this astray.
            ground.floor[:] *= np.float32(gain)
            ground.levels[:] = _rounded(ground.floor)

    def _search(self, tray: Tray, species: Species, pixels_per_metre: float) -> Search:
        low = 0.5 * species.diameter_low * pixels_per_metre
        high = 0.5 * species.diameter_high * pixels_per_metre
        kind = _kind(species)
        factor = _GRAY_SIZE_STEP if kind == GRAY else _SIZE_STEP
        sizes = max(1, int(np.ceil(np.log(high / low) / np.log(factor))))
        grains = 0.25 * np.pi * species.diameter**2 * species.count
        area = tray.dimensions[0] * tray.dimensions[1]
        crowded = kind == GRAY and grains > self._settings.most_crowded * area
        # Under chalk, what is left of a large bead may pass for a small one.
        least = _LEAST_SLIVER if self._dusty and high > _MANY_SIZES * low else 0.0
        spread = max((high - low) / np.sqrt(12.0), _SIZE_SPREAD_PX)
        return Search(
            kind=kind,
            hue_sign=_HUE_SIGN[kind],
            radii=np.geomspace(low, high, 2 * sizes + 1)[1::2].copy(),
            expected=np.array([0.5 * (low + high), spread]),
            step=max(2 if low >= _COARSE_FROM_PX else 1, int(low / _SQUARES_PER_RADIUS)),
            most=0 if crowded else int(_SURPLUS * species.count) + 2,
            floor_weight=1 if self._dusty else _FLOOR_WEIGHT,
            least_share=max(self._settings.least_area_seen, least),
        )


class _Ground(NamedTuple):
    """The floor as far as it is known, and room to look at a picture.

    `floor` and `levels` are (rows, columns, 3), as numbers and rounded; `sure` is where it has
    been seen.
    """

    floor: NDArray[np.float32]
    levels: NDArray[np.uint8]
    sure: NDArray[np.bool_]
    picture: Picture


def _kind(species: Species) -> int:
    return {1: RED, -1: BLUE, 0: GRAY}[species.properties.hue]


def _rounded(floor: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.asarray(np.clip(floor + 0.5, 0.0, 255.0), dtype=np.uint8)


def _detections(discs: NDArray[np.float64], fits: NDArray[np.float64]) -> Detections:
    # Columns on their own: those of many rows are another type for the compiler than of one.
    errors, radius_errors, outline_seen, area_seen = np.ascontiguousarray(fits.T)
    return Detections(
        places=discs[:, :2].copy(),
        place_errors=errors,
        radii=discs[:, 2].copy(),
        radius_errors=radius_errors,
        outline_seen=outline_seen,
        area_seen=area_seen,
    )
