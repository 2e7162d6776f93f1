"""Colours and sizes of the discs that are known to be beads.

Tested by ``test/stages/tracking/scene/test_known_beads.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.stages.tracking.scene.outlines.disc_kernels import have_near

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.bead_looks import Candidates

ALIKE = 3.0
"""Distance of a disc to a known bead up to which it looks alike, in spreads of these."""

# Part of the known beads that may have been taken for beads by mistake.
_KNOWN_SHARE = 0.03
_LEAST_COLOUR_SPREAD, _LEAST_RADIUS_SPREAD = 6.0, 0.05
_MOST_SAMPLES = 400
# Of so many known beads two are alike, and of so many three.
_MANY = 6, 24
# The outline of a disc at rest has at least this part of the quality of those that move, of which
# so many are worse. Less moves of it than this part of what usually does: a bead may pass by.
_AT_REST_SHARE, _USUALLY_WORST, _LESS_MOVING = 0.6, 0.05, 0.5


@dataclass(frozen=True, slots=True)
class KnownBeads:
    """Discs that are known to be beads.

    Parameters
    ----------
    tree : cKDTree
        Colours and logarithms of the radii, over the spread of each.
    spreads : ndarray (4,)
    sizes : tuple of 2 floats
        The usual smallest and largest logarithm of a radius, over its spread.
    """

    tree: cKDTree
    spreads: NDArray[np.float64]
    sizes: tuple[float, float]

    @classmethod
    def of(cls, colours: NDArray[np.float64], radii: NDArray[np.float64]) -> KnownBeads | None:
        """Those with these colours (n, 3) and radii (n,); None without any."""
        if len(radii) == 0:
            return None
        features = np.column_stack([colours, np.log(radii)])
        spread = 1.4826 * np.median(np.abs(features - np.median(features, axis=0)), axis=0)
        spreads = np.maximum(spread, [_LEAST_COLOUR_SPREAD] * 3 + [_LEAST_RADIUS_SPREAD])
        every = max(1, len(features) // _MOST_SAMPLES)
        low, high = np.quantile(features[:, 3], [_KNOWN_SHARE, 1.0 - _KNOWN_SHARE]) / spreads[3]
        return cls(cKDTree(features[::every] / spreads), spreads, (float(low), float(high)))

    @property
    def colours(self) -> NDArray[np.float64]:
        """Colours of some of these discs, (n, 3), bgr, [gray levels]."""
        return np.asarray(self.tree.data[:, :3] * self.spreads[:3])

    def distances(
        self, colours: NDArray[np.float64], radii: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Distance of discs with colours (n, 3) and radii (n,) to known beads, in spreads."""
        features = np.column_stack([colours, np.log(radii)]) / self.spreads
        return np.asarray(self.tree.query(features, k=[self._nearest])[0][:, 0])

    def are_near(
        self,
        colours: NDArray[np.float64],
        radii: NDArray[np.float64],
        limits: NDArray[np.float64],
    ) -> NDArray[np.bool_]:
        """Which discs are nearer than limits (n,) to known beads, in spreads, by `distances`."""
        features = np.column_stack([colours, np.log(radii)]) / self.spreads
        near = np.empty(len(features), dtype=bool)
        # Most discs are beads, near to many: a search for the nearest ones would take longer.
        have_near(features, self.tree.data, limits, self._nearest, near)
        return near

    @property
    def _nearest(self) -> int:
        """Number of the known bead that counts, from the nearest on."""
        # Not the nearest: what was taken for a bead by mistake is known, too.
        count = int(self.tree.n)
        least = 1 + sum(count >= many for many in _MANY)
        return max(least, round(_KNOWN_SHARE * count))

    def have_size(self, radii: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether radii (n,) are those of beads: light and shadow change colours, not sizes."""
        sizes = np.log(radii) / self.spreads[3]
        low, high = self.sizes
        return np.asarray((sizes > low - ALIKE) & (sizes < high + ALIKE))


class AtRest(NamedTuple):
    """What is asked of discs at rest: a stain may look like a clear bead.

    Parameters
    ----------
    moving : float
        At rest are those of which less differs from the background.
    quality : float
        Of their outlines, at least.
    """

    moving: float = 0.0
    quality: float = 0.0

    @classmethod
    def beside(cls, moved: Candidates) -> AtRest:
        """What is asked beside beads that move."""
        usually_worst = float(np.quantile(moved.outlines.quality, _USUALLY_WORST))
        usual = float(np.median(moved.moving))
        return cls(_LESS_MOVING * usual, _AT_REST_SHARE * usually_worst)

    def allows(self, discs: Candidates) -> NDArray[np.bool_]:
        """Which discs move, or show well enough."""
        rests = discs.moving < self.moving
        return np.asarray(~rests | (discs.outlines.quality >= self.quality))
