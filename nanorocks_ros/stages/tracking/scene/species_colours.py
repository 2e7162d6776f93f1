"""Which discs have the colour of which species, where that of some is told.

Tested by ``test/stages/tracking/scene/test_species_colours.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.scene.bead_looks import shaded_distances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook

# Part of the difference in brightness that adds to that in colour: white and gray differ by it.
_SHADE_PART = 0.1
# Two colours are those of two species when they lie so many standard deviations of the discs
# apart: the halves of one normal distribution 2.6, those of an even one 3.5.
_APART = 4.0
# Smallest standard deviation, [gray levels].
_LEAST_SPREAD = 3.0
# A disc has the colour that is told where it is this much nearer to it than its surroundings,
# if the film shows one colour alone.
_NEARER = 0.5
_ITERATIONS = 20


class _Centre(NamedTuple):
    """A colour of discs, and the species that has it; -1: any of those whose colour is learnt."""

    colour: NDArray[np.float64]
    species: int


class SpeciesColours:
    """Tells the discs of species apart by their colours.

    What is told is where the search for the colours in the film starts: light and camera change
    them. Species whose colour is not told have what is left.

    Parameters
    ----------
    looks : sequence of BeadLook
        Of all species.
    """

    def __init__(self, looks: Sequence[BeadLook]) -> None:
        self._looks = list(looks)
        self._told = [k for k, look in enumerate(looks) if look.colour is not None]
        self._learnt = [k for k, look in enumerate(looks) if look.colour is None]
        self._centres = self._as_told()

    def learn(self, colours: NDArray[np.float64]) -> None:
        """Find the colours of the species among those of beads, (n, 3), bgr, [gray levels]."""
        self._centres = self._as_told()
        if len(colours) == 0 or len(self._looks) == 1 or not self._told:
            return
        if self._learnt:
            # The colour that explains most of those that are not told.
            costs = _distances(colours, self._centres).min(axis=1)
            between = np.stack([_distance(colours, colour) for colour in colours])
            best = int(np.minimum(between, costs).sum(axis=1).argmin())
            self._centres.append(_Centre(colours[best], -1))
        nearest = np.full(len(colours), -1)
        for _ in range(_ITERATIONS):
            before, nearest = nearest, _distances(colours, self._centres).argmin(axis=1)
            if np.array_equal(before, nearest):
                break
            self._centres = [
                centre._replace(colour=np.median(colours[nearest == k], axis=0))
                if (nearest == k).any()
                else centre
                for k, centre in enumerate(self._centres)
            ]
        if self._learnt and not self._stands_apart(colours, nearest):
            self._centres = self._as_told()

    def of(
        self, k: int, colours: NDArray[np.float64], around: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which discs, by colours (n, 3) inside and around them, may be beads of species k."""
        told = self._looks[k].colour
        if told is None:
            return ~self._of_others(k, colours, around)
        # Nearer to the colour that is told than what is around it.
        may_be = shaded_distances(colours, told) <= shaded_distances(around, told)
        owners = np.array([centre.species for centre in self._centres])
        may_be &= owners[_distances(colours, self._centres).argmin(axis=1)] == self._owner(k)
        if -1 not in owners and any(self._share_sizes(k, j) for j in self._learnt):
            may_be &= self._much_nearer(k, colours, around)
        return np.asarray(may_be)

    def _of_others(
        self, k: int, colours: NDArray[np.float64], around: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which discs have the colour of another species than k, whose own is not told."""
        owners = np.array([centre.species for centre in self._centres])
        if -1 in owners:
            return np.asarray(owners[_distances(colours, self._centres).argmin(axis=1)] >= 0)
        others = np.zeros(len(colours), dtype=bool)
        for j in self._told:
            if self._share_sizes(k, j):
                others |= self._much_nearer(j, colours, around)
        return others

    def _much_nearer(
        self, k: int, colours: NDArray[np.float64], around: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        told = self._looks[k].colour
        if told is None:
            return np.zeros(len(colours), dtype=bool)
        return np.asarray(
            shaded_distances(colours, told) <= _NEARER * shaded_distances(around, told)
        )

    def _share_sizes(self, j: int, k: int) -> bool:
        """Whether discs of one radius may be those of either species; unknown radii are any."""
        (low, high), (other_low, other_high) = self._looks[j].radii, self._looks[k].radii
        return not (high < other_low or other_high < low)

    def _owner(self, k: int) -> int:
        """The first species with the same colour, which stands for all of these."""
        return next(j for j in self._told if self._looks[j].colour == self._looks[k].colour)

    def _as_told(self) -> list[_Centre]:
        return [
            _Centre(np.array(self._looks[k].colour), k) for k in self._told if self._owner(k) == k
        ]

    def _stands_apart(self, colours: NDArray[np.float64], nearest: NDArray[np.intp]) -> bool:
        """Whether the colour that was learnt is not a part of one that is told."""
        own = nearest == len(self._centres) - 1
        for k, centre in enumerate(self._centres[:-1]):
            its = nearest == k
            if not its.any():
                continue
            between = self._centres[-1].colour - centre.colour
            length = float(np.linalg.norm(between))
            along = [colours[rows] @ between / max(length, 1e-9) for rows in (own, its)]
            scatter = [float(((part - part.mean()) ** 2).sum()) for part in along]
            spread = (sum(scatter) / (own.sum() + its.sum())) ** 0.5
            if length < _APART * max(spread, _LEAST_SPREAD):
                return False
        return True


def _distance(colours: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of colours (n, 3) to one, mostly of their hue, (n,), [gray levels]."""
    shade = np.linalg.norm(colours - centre, axis=1)
    blue, green, red = centre.tolist()
    return np.asarray(shaded_distances(colours, (blue, green, red)) + _SHADE_PART * shade)


def _distances(colours: NDArray[np.float64], centres: Sequence[_Centre]) -> NDArray[np.float64]:
    """Distance of each colour to each centre, (n, centres)."""
    return np.stack([_distance(colours, centre.colour) for centre in centres], axis=1)
