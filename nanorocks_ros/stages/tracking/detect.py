"""Beads in one picture of a tray: species, place and size of each, with errors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.cover import cover
from nanorocks_ros.stages.tracking.floor import first_floor, renew_floor
from nanorocks_ros.stages.tracking.outline import refit
from nanorocks_ros.stages.tracking.pixels import (
    BLUE,
    GRAY,
    RED,
    look_at_dusty_pixels,
    look_at_pixels,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import TrackingSettings
    from nanorocks_ros.experiment.trays import Species, Tray

KINDS = {'acrylic': RED, 'copper': RED, 'glass': BLUE, 'JSC-1': GRAY}
"""Colour of the species that were flown; others are taken for gray."""

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


@dataclass(frozen=True, slots=True)
class _Search:
    """How one species is looked for."""

    kind: int
    radii: NDArray[np.float64]
    expected: NDArray[np.float64]
    step: int
    most: int


class BeadDetector:
    """Finds the beads of one tray.

    Parameters
    ----------
    settings : TrackingSettings
    tray : Tray
    pixels_per_metre : float, [px/m]
    """

    def __init__(self, settings: TrackingSettings, tray: Tray, pixels_per_metre: float) -> None:
        self._least_share = settings.least_area_seen
        area = tray.dimensions[0] * tray.dimensions[1]
        self._searches = [
            _search(one, pixels_per_metre, area * settings.most_crowded) for one in tray.species
        ]
        self._gray_known = any(one.kind == GRAY for one in self._searches)
        largest = max(one.diameter_high for one in tray.species)
        self._reach = max(3, round(largest * pixels_per_metre))
        self._dusty = tray.chalk and not self._gray_known
        self._turn = 0
        self._floor: NDArray[np.float32] | None = None

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
        hints = hints or [np.empty((0, 4))] * len(self._searches)
        if self._floor is None or self._floor.shape != color.shape:
            self._start(color)
        floor = self._floor
        assert floor is not None
        look_at_pixels(
            color, self._levels, self._gray_known, self._darkness, self._hue, self._shown
        )
        if self._dusty:
            self._hue = cv2.blur(self._hue, (_DUSTY_BLUR_PX, _DUSTY_BLUR_PX))
            look_at_dusty_pixels(self._hue, self._levels, self._darkness, self._shown)
        self._covered[:] = 0
        found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = [None] * len(hints)
        # Gray ones last: the outline of a coloured bead looks gray.
        for k in sorted(range(len(hints)), key=lambda k: self._searches[k].kind == GRAY):
            found[k] = self._cover(self._searches[k], hints[k])
        every = np.concatenate([discs for discs, _ in found])
        detections = []
        first = 0
        for search, (discs, fits) in zip(self._searches, found, strict=True):
            refit(
                self._darkness,
                self._hue,
                _HUE_SIGN[search.kind],
                every,
                first,
                len(discs),
                search.expected,
                fits,
            )
            fitted = every[first : first + len(discs)]
            first += len(discs)
            detections.append(
                Detections(
                    places=fitted[:, :2].copy(),
                    place_errors=fits[:, 0],
                    radii=fitted[:, 2].copy(),
                    radius_errors=fits[:, 1],
                    outline_seen=fits[:, 2],
                    area_seen=fits[:, 3],
                )
            )
        gain = renew_floor(
            color,
            self._covered,
            self._gray_known,
            self._turn,
            floor,
            self._levels,
            self._sure,
        )
        if abs(gain - 1.0) > _LIGHT_CHANGE and not (self._gray_known or self._dusty):
            # The rows in turn are too slow for a light that changes everywhere. Grains and
            # chalk that pass for floor would lead this astray.
            floor *= np.float32(gain)
            self._levels = np.clip(floor + 0.5, 0.0, 255.0).astype(np.uint8)
        self._turn += 1
        return tuple(detections)

    def _start(self, color: NDArray[np.uint8]) -> None:
        self._floor, self._sure = first_floor(color, self._gray_known, self._reach)
        self._levels = np.clip(self._floor + 0.5, 0.0, 255.0).astype(np.uint8)
        shape = color.shape[:2]
        self._darkness = np.empty(shape, dtype=np.uint8)
        self._hue = np.empty(shape, dtype=np.int16)
        self._shown = np.empty(shape, dtype=np.uint8)
        self._covered = np.zeros(shape, dtype=np.uint8)

    def _cover(
        self, search: _Search, hints: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        discs = np.zeros((search.most, 3))
        fits = np.zeros((search.most, 4))
        count = cover(
            self._shown,
            self._darkness,
            self._hue,
            search.kind,
            _HUE_SIGN[search.kind],
            search.radii,
            search.expected,
            1 if self._dusty else _FLOOR_WEIGHT,
            search.step,
            search.most,
            self._least_share,
            self._covered,
            discs,
            fits,
            hints,
        )
        return discs[:count], fits[:count]


def _search(species: Species, pixels_per_metre: float, most_area: float) -> _Search:
    low = 0.5 * species.diameter_low * pixels_per_metre
    high = 0.5 * species.diameter_high * pixels_per_metre
    kind = KINDS.get(species.material, GRAY)
    factor = _GRAY_SIZE_STEP if kind == GRAY else _SIZE_STEP
    sizes = max(1, int(np.ceil(np.log(high / low) / np.log(factor))))
    ends = np.geomspace(low, high, 2 * sizes + 1)
    covered = 0.25 * np.pi * species.diameter**2 * species.count
    crowded = kind == GRAY and covered > most_area
    spread = max((high - low) / np.sqrt(12.0), _SIZE_SPREAD_PX)
    return _Search(
        kind=kind,
        radii=ends[1::2].copy(),
        expected=np.array([0.5 * (low + high), spread]),
        step=max(2 if low >= _COARSE_FROM_PX else 1, int(low / _SQUARES_PER_RADIUS)),
        most=0 if crowded else int(_SURPLUS * species.count) + 2,
    )
