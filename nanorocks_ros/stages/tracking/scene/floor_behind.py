"""The floor behind discs tells where a bead was before, and which discs are shadows.

Tested by ``test/stages/tracking/scene/test_floor_behind.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.known_beads import KnownBeads

# The background has so many times more contrast where a bead has left, and so much more.
_LEFT_CONTRAST, _LEAST_CONTRAST = 1.5, 6.0
# Light that a shadow leaves to the floor, and what its colour may differ by from that of a darker
# floor, over the change of the floor.
_LIGHT, _OTHER_HUE = (0.2, 0.95), 0.3
# A shadow lies within so many radii of the bead that casts it, and always at one place beside it,
# within this part of the radius.
_FARTHEST, _SAME_PLACE = 2.5, 0.35
# Nearer than so many radii a shadow lies partly under its bead, where no other bead can be.
_OVERLAPS = 1.7
# A bead that stays casts one shadow: places of beads are at least this many radii apart. So many
# show that shadows are cast, and this share of the dark discs beside beads has to be at one place.
_OTHER_PLACE, _LEAST_PLACES, _LEAST_SHARE = 1.0, 4, 0.8


def left_behind(
    now: tuple[NDArray[np.float64], NDArray[np.float64]],
    before: tuple[NDArray[np.float64], NDArray[np.float64]],
    known: KnownBeads | None,
    radii: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Discs that a bead has left: they show in the background, and less in the frame.

    Parameters
    ----------
    now, before : tuples of 2 ndarrays (n, 3)
        Colours inside and around the discs, in the frame and in the background.
    known : KnownBeads or None
    radii : ndarray (n,), [px]
    """
    contrast, contrast_before = (
        np.linalg.norm(own - other, axis=1) for own, other in (now, before)
    )
    left = np.asarray(contrast_before > _LEFT_CONTRAST * contrast + _LEAST_CONTRAST)
    if known is not None and left.any():
        # Beside a dark wall the bright floor that a bead hides stands out more than the bead.
        here, gone = (known.distances(inside[left], radii[left]) for inside, _ in (now, before))
        left[left] = gone < here
    return left


def darken(colours: NDArray[np.float64], floor: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which colours (n, 3) are those of the floor (n, 3), darker; none where it is NaN."""
    light = (colours * floor).sum(axis=1) / np.maximum((floor**2).sum(axis=1), 1.0)
    other_hue = np.linalg.norm(colours - light[:, None] * floor, axis=1)
    change = np.linalg.norm(colours - floor, axis=1)
    least, most = _LIGHT
    return np.asarray((light > least) & (light < most) & (other_hue < _OTHER_HUE * change))


@dataclass(frozen=True, slots=True)
class CastShadows:
    """Shadows of beads that show as discs.

    Parameters
    ----------
    offset : ndarray (2,)
        From a bead to its shadow, in radii of the bead: across and down.
    """

    offset: NDArray[np.float64]

    @classmethod
    def of(
        cls, discs: NDArray[np.float64], dark: NDArray[np.bool_], frames: NDArray[np.intp]
    ) -> CastShadows | None:
        """Those among discs of a film; None unless the dark ones lie at one place beside others.

        Parameters
        ----------
        discs : ndarray (n, 3)
            Those that move: column, row, radius.
        dark : ndarray of bool, (n,)
            Those that darken the floor.
        frames : ndarray of int, (n,)
            Number of the frame of each.
        """
        if not dark.any() or dark.all():
            return None
        each = [frames == number for number in np.unique(frames)]
        pairs = [_beside(discs[here & dark], discs[here & ~dark]) for here in each]
        casters, offsets = (np.concatenate(rows) for rows in zip(*pairs, strict=True))
        chosen = _places_apart(casters)
        if len(chosen) < _LEAST_PLACES:
            return None
        offset = np.median(offsets[chosen], axis=0)
        same = int((np.linalg.norm(offsets[chosen] - offset, axis=1) < _SAME_PLACE).sum())
        enough = max(_LEAST_PLACES, _LEAST_SHARE * len(chosen))
        return cls(offset) if same >= enough and np.hypot(*offset) < _FARTHEST else None

    def among(
        self, discs: NDArray[np.float64], alike: NDArray[np.bool_], dark: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Which discs (n, 3) of a frame, in which these look like beads or are dark, are shadows.

        Partly on its shadow, a bead hides the darkness of it.
        """
        shadows = dark.copy()
        casters = discs[alike & ~dark]
        if len(casters) and np.hypot(*self.offset) < _OVERLAPS:
            places = casters[:, :2] + casters[:, 2:] * self.offset
            near, nearest = cKDTree(places).query(discs[:, :2])
            shadows |= near < _SAME_PLACE * casters[nearest, 2]
        return shadows


def _beside(
    dark: NDArray[np.float64], others: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The nearest other disc of each dark one, (n, 3), and the way from it, in its radii."""
    if len(dark) == 0 or len(others) == 0:
        return np.empty((0, 3)), np.empty((0, 2))
    casters = others[cKDTree(others[:, :2]).query(dark[:, :2])[1]]
    offsets = (dark[:, :2] - casters[:, :2]) / casters[:, 2:]
    return casters, offsets


def _places_apart(casters: NDArray[np.float64]) -> list[int]:
    """Numbers of discs so that no two are at one place."""
    chosen: list[int] = []
    for k, (x, y, radius) in enumerate(casters):
        apart = np.hypot(casters[chosen, 0] - x, casters[chosen, 1] - y)
        if (apart > _OTHER_PLACE * radius).all():
            chosen.append(k)
    return chosen
