"""Detection of beads whose look is learnt from the film: any colour, on any floor."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.stages.tracking.detection.bead_detector import Detections
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.scene_model import SceneModel, scene_model
from nanorocks_ros.stages.tracking.scene.species_colours import SpeciesColours

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.stages.tracking.scene.bead_looks import Candidates

# Frames kept to learn from, spread over the film; the look is learnt again whenever the number
# of frames has grown by the factor.
_KEPT_FRAMES = 25
_GROWTH = 3
# Radii beyond the range that is told, as a factor: perspective, blur.
_RADIUS_TOLERANCE = 1.2
# The background follows the light by one level in so many frames.
_FOLLOWING_FRAMES = 5
# Systematic error of a position: light and shadow on the outline, [px].
_LEAST_ERROR_PX = 0.03
# In a layer, up to this height over the diameter, beads are so many radii apart in the picture.
_LAYER, _LAYER_APART = 1.25, 1.25
# Vertices of masks have this resolution, [px].
_SUBPIXEL_BITS = 4


class _RankedDiscs(NamedTuple):
    """Discs of one species in a frame: column, row, radius; errors; support; how good they are."""

    discs: NDArray[np.float64]
    errors: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    support: NDArray[np.float64]
    score: NDArray[np.float64]

    def chosen(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> _RankedDiscs:
        return _RankedDiscs(*(values[rows] for values in self))


class _Alike(NamedTuple):
    """Species that look alike, as one: limits of the radii of each, [px], by its number."""

    look: BeadLook
    limits: dict[int, tuple[float, float]]


class SceneDetector:
    """Finds the beads of one tray by what the film shows.

    Parameters
    ----------
    tray : Tray
        Species without an appearance are learnt, too.
    pixels_per_metre : float, [px/m]
    """

    crowded = False
    darkness = None

    def __init__(self, tray: Tray, pixels_per_metre: float) -> None:
        self._tray = tray
        self._scale = pixels_per_metre
        self._looks = [_look(tray, species, pixels_per_metre) for species in tray.species]
        self._groups = _alike(self._looks)
        self._colours = SpeciesColours(self._looks)
        self._models: list[SceneModel] = []
        self._kept: list[NDArray[np.uint8]] = []
        self._every = 1
        self._frames = 0
        self._learnt_at = 0
        self._allowed: NDArray[np.bool_] | None = None

    def learn(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        """Learn the look of the beads from frames of the whole film, ahead of the first.

        Parameters
        ----------
        frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
        """
        self._learn_from(frames)
        # Nothing is to be learnt any more.
        self._learnt_at = -1

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
        self._learn_on(color)
        of_species: dict[int, _RankedDiscs] = {}
        for group, model in zip(self._groups, self._models, strict=True):
            known = None
            if len(hints):
                known = np.concatenate([hints[k][:, :3] for k in group.limits])
                known = known - [0.5, 0.5, 0.0]
            candidates = model.candidates(color, known)
            alike = model.alike(candidates)
            alike &= self._is_allowed(candidates.outlines.discs, color.shape)
            for k, limits in group.limits.items():
                of_species[k] = self._of_species(k, candidates, alike, limits)
            if self._frames % _FOLLOWING_FRAMES == 0:
                model.colours.follow(color)
        self._frames += 1
        return tuple(
            _detections(rows)
            for rows in self._best_of_species([of_species[k] for k in range(len(of_species))])
        )

    def _learn_on(self, color: NDArray[np.uint8]) -> None:
        """Keep frames spread over the film so far, and learn from them again as it grows."""
        if self._learnt_at < 0:
            return
        if self._models and color.shape != self._kept[0].shape:
            self._kept, self._frames, self._learnt_at, self._every = [], 0, 0, 1
        if self._frames % self._every == 0:
            self._kept.append(color.copy())
            if len(self._kept) == 2 * _KEPT_FRAMES:
                del self._kept[1::2]
                self._every *= 2
        if self._frames >= _GROWTH * self._learnt_at or not self._models:
            self._learn_from(self._kept)
            self._learnt_at = max(self._frames, 1)

    def _learn_from(self, frames: Sequence[NDArray[np.uint8]]) -> None:
        self._models = [scene_model(frames, group.look) for group in self._groups]
        self._colours.learn(np.concatenate([model.bead_colours for model in self._models]))
        if len(self._models) > 1:
            for group, model in zip(self._groups, self._models, strict=True):
                model.attend_to(frames, partial(self._colours.of, min(group.limits)))

    def _of_species(
        self,
        k: int,
        candidates: Candidates,
        alike: NDArray[np.bool_],
        limits: tuple[float, float],
    ) -> _RankedDiscs:
        """Discs that look like beads of a species, of radii within its limits; the best first."""
        outlines = candidates.outlines
        alike = alike & self._colours.of(k, candidates.colours, candidates.around)
        alike &= (outlines.discs[:, 2] >= limits[0]) & (outlines.discs[:, 2] < limits[1])
        # Where the film is not known to its end, they may move yet.
        aside = candidates.aside & (self._learnt_at < 0)
        if self._tray.species[k].expected is None:
            alike &= ~aside
        discs = _RankedDiscs(
            outlines.discs,
            np.hypot(outlines.errors, _LEAST_ERROR_PX),
            outlines.radius_errors,
            outlines.support,
            # As many as told may lie aside; of any number these are none.
            outlines.quality - aside,
        ).chosen(alike)
        return discs.chosen(np.argsort(-discs.score, kind='stable'))

    def _is_allowed(self, discs: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which centres lie inside, and on no mask."""
        if self._tray.inside is None and not self._tray.masks:
            return np.ones(len(discs), dtype=bool)
        if self._allowed is None or self._allowed.shape != shape[:2]:
            self._allowed = self._painted(shape)
        limits = np.array([shape[1], shape[0]]) - 1
        columns, rows = np.clip(np.rint(discs[:, :2]), 0, limits).astype(np.intp).T
        return np.asarray(self._allowed[rows, columns])

    def _painted(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        allowed = np.full(shape[:2], int(self._tray.inside is None), dtype=np.uint8)
        if self._tray.inside is not None:
            self._fill(allowed, self._tray.inside, 1)
        for mask in self._tray.masks:
            self._fill(allowed, mask, 0)
        return allowed.astype(bool)

    def _fill(
        self, picture: NDArray[np.uint8], corners: tuple[tuple[float, float], ...], value: int
    ) -> None:
        places = (np.array(corners) * self._scale - 0.5) * 2**_SUBPIXEL_BITS
        cv2.fillPoly(picture, [np.rint(places).astype(np.int32)], value, shift=_SUBPIXEL_BITS)

    def _best_of_species(self, found: list[_RankedDiscs]) -> list[_RankedDiscs]:
        """At most as many discs as told, and each place for the species that fits it best."""
        best = []
        for k, rows in enumerate(found):
            others = [other for j, other in enumerate(found) if j != k]
            keep = np.ones(len(rows.discs), dtype=bool)
            for other in others:
                if len(other.discs) and len(rows.discs):
                    near, nearest = cKDTree(other.discs[:, :2]).query(rows.discs[:, :2])
                    better = other.score[nearest] > rows.score
                    keep &= ~((near < rows.discs[:, 2]) & better)
            best.append(rows.chosen(keep).chosen(np.arange(min(keep.sum(), self._count(k)))))
        return best

    def _count(self, k: int) -> int:
        return self._tray.species[k].count


def _look(tray: Tray, species: Species, pixels_per_metre: float) -> BeadLook:
    appearance = species.appearance
    low = 0.5 * species.diameter_low * pixels_per_metre / _RADIUS_TOLERANCE
    high = 0.5 * species.diameter_high * pixels_per_metre * _RADIUS_TOLERANCE
    return BeadLook(
        radii=(low, high) if math.isfinite(low) else (math.nan, math.nan),
        sign=0 if appearance is None else appearance.sign,
        apart=_LAYER_APART if not tray.dimensions[2] > _LAYER * species.diameter_high else 1.0,
        colour=species.properties.color if appearance is None else appearance.colour,
    )


def _alike(looks: Sequence[BeadLook]) -> list[_Alike]:
    """The species in groups that look alike, each with the limits of its radii.

    A limit lies half way between two sizes. Of species whose sizes overlap the first has all
    discs: nothing that shows tells them apart.
    """
    groups = []
    for key in dict.fromkeys((look.sign, look.colour) for look in looks):
        members = [k for k, look in enumerate(looks) if (look.sign, look.colour) == key]
        joined = replace(
            looks[members[0]],
            radii=(
                min(looks[k].radii[0] for k in members),
                max(looks[k].radii[1] for k in members),
            ),
            apart=min(looks[k].apart for k in members),
        )
        groups.append(_Alike(joined, _limits({k: looks[k].radii for k in members})))
    return groups


def _limits(radii: Mapping[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
    """Smallest and largest radius of the discs of each species, by what is told of these."""
    # As told: without the tolerance.
    told = {
        k: (low * _RADIUS_TOLERANCE, high / _RADIUS_TOLERANCE) for k, (low, high) in radii.items()
    }
    # Largest radius of species whose sizes overlap, and these.
    sizes: list[tuple[float, list[int]]] = []
    edges = [0.0]
    for k in sorted(told, key=lambda k: told[k]):
        low, high = told[k]
        if sizes and not low > sizes[-1][0] * (1.0 + 1e-9):
            largest, members = sizes.pop()
            sizes.append((max(largest, high), [*members, k]))
            continue
        if sizes:
            edges.append(math.sqrt(sizes[-1][0] * low))
        sizes.append((high, [k]))
    limits = dict.fromkeys(told, (math.inf, math.inf))
    for (_, members), between in zip(sizes, pairwise([*edges, math.inf]), strict=True):
        limits[min(members)] = between
    return limits


def _detections(found: _RankedDiscs) -> Detections:
    return Detections(
        # The centre of the first pixel is at (0.5, 0.5).
        positions=found.discs[:, :2] + 0.5,
        position_errors=found.errors.copy(),
        radii=found.discs[:, 2].copy(),
        radius_errors=found.radius_errors.copy(),
        visible_outline=found.support.copy(),
        visible_share=np.minimum(found.support, 1.0),
    )
