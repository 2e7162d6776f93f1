"""Whether the tracks of a tray are good enough for speeds and contacts.

Tested by ``test/stages/speed/test_speed_selector.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.quantiles import median
from nanorocks_ros.stages.tracking.mean_speed import RELIABLE_SHARE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Tracks

# Share of the beads of each species that must be tracked, of those that do not lie under others,
# to begin and to go on; and where there are grains, whose tracks are cut where they jump
# (`jumping_tracks`).
_ENOUGH, _STILL_ENOUGH = 0.85, 0.7
_ENOUGH_GRAINS, _STILL_ENOUGH_GRAINS, _RELIABLE_SHARE_GRAINS = 0.7, 0.55, 0.4
# Pictures over which the median of that share is taken; and speeds, for the share of the beads
# that could be tracked through the window of a speed.
_MEMORY_FRAMES = 30
_MEMORY_SPEEDS = 10
# Path of a bead between two pictures, over half the distance of beads that lie at random: beyond
# it beads are taken for their neighbours, which are further away. Simulated speeds were right to
# 10 % up to 0.8, and off by 30 % and more from 1.4 on.
_LONGEST_STEP = 1.0


class TrackReliability:
    """Judges the tracks of one tray.

    Parameters
    ----------
    tray : Tray
    crowded : bool
        Whether a species has too many grains to be tracked.

    Attributes
    ----------
    reliable : bool
        Whether nearly all beads of every species are being tracked.
    reliable_contacts : bool
        Whether contacts and bodies in these tracks can be believed, too.
    judged : bool
        Whether enough images were seen to tell.
    hopeless : bool
        Whether a species is too crowded to be tracked, so that it will never be reliable.
    lowest_share : float
        Share of the beads that must be tracked through the window of a speed.
    hidden : float, 0 to 1
        Share of the beads that lie under others, of the species that has most of them.
    """

    def __init__(self, tray: Tray, *, crowded: bool) -> None:
        self._counts = np.array([species.count for species in tray.species])
        self._shares = np.empty((_MEMORY_FRAMES, self._counts.size))
        self._frames = 0
        self._enough, self._nearly_all = False, False
        self._tracked: deque[float] = deque(maxlen=_MEMORY_SPEEDS)
        self._hidden: deque[float] = deque(maxlen=_MEMORY_SPEEDS)
        grains = any(species.properties.shape == 'grain' for species in tray.species)
        # Grains that are shaken are confused at once; how many are seen tells it too late.
        self._steps: deque[float] = deque(maxlen=1 if grains else _MEMORY_SPEEDS)
        # Medians of these two.
        self._usual_tracked, self._usual_step = 0.0, math.inf
        area = tray.dimensions[0] * tray.dimensions[1]
        self._neighbours = 0.5 * np.sqrt(area / self._counts)
        self._enough_share = (
            (_ENOUGH_GRAINS, _STILL_ENOUGH_GRAINS) if grains else (_ENOUGH, _STILL_ENOUGH)
        )
        self.lowest_share = _RELIABLE_SHARE_GRAINS if grains else RELIABLE_SHARE
        self.hopeless = crowded
        self.reliable, self.reliable_contacts = False, False
        self.judged = crowded
        self.hidden = 0.0

    @property
    def told_apart(self) -> bool:
        """Whether the path of a bead between two pictures is shorter than the way to others."""
        return self._usual_step <= _LONGEST_STEP

    def push(self, tracks: Tracks) -> None:
        """Judge by the next picture."""
        row = self._frames % _MEMORY_FRAMES
        frames = min(self._frames + 1, _MEMORY_FRAMES)
        # A track is believed after some pictures only: the first ones show none.
        share = _smallest_share(
            tracks.species, tracks.seen, self._counts, self._shares, row, frames
        )
        self._frames += 1
        if self.hopeless:
            return
        self.judged = self._frames >= _MEMORY_FRAMES
        self._enough = share >= (1.0 - self.hidden) * self._enough_share[int(self.reliable)]
        # Beads that lie under others can touch those that are seen.
        self._nearly_all = share >= (_STILL_ENOUGH if self.reliable_contacts else _ENOUGH)
        if self.judged:
            self._conclude()

    def push_speeds(
        self,
        share: float,
        hidden: float,
        speeds: NDArray[np.float64],
        intervals_ns: NDArray[np.int64],
    ) -> None:
        """Take what the speeds of one window say.

        Parameters
        ----------
        share : float
            Of the beads that do not lie under others, those that were tracked through the window,
            of the worst species.
        hidden : float, 0 to 1
            Share of the beads that lie under others, of the species that has most of them.
        speeds : ndarray (species,), [m/s]
            NaN where it is not known.
        intervals_ns : ndarray of int64, [ns]
            Between the pictures of the window.
        """
        interval = median(intervals_ns.tolist()) / 1_000_000_000
        step = float(np.max(np.nan_to_num(speeds) * interval / self._neighbours))
        self._tracked.append(share)
        self._hidden.append(hidden)
        self._steps.append(step)
        self._usual_tracked = median(self._tracked)
        self._usual_step = median(self._steps)
        # Crowded grains hide each other everywhere, which the structure function takes in account.
        self.hidden = 0.0 if self.hopeless else median(self._hidden)

    def without_colour(self) -> None:
        """Judge by an image without colour, in which nothing can be tracked."""
        self.judged, self.reliable, self.reliable_contacts = True, False, False

    def conclude(self) -> None:
        """Judge by the pictures so far, since there will be no more."""
        if not self.judged:
            self.judged = True
            self._conclude()

    def _conclude(self) -> None:
        self.reliable = self._enough and self._good()
        self.reliable_contacts = self.reliable and self._nearly_all

    def _good(self) -> bool:
        # Where many beads are lost and found again, others are taken for them.
        return self._usual_tracked >= self.lowest_share and self.told_apart


@compiled
def _smallest_share(
    species: NDArray[np.int32],
    seen: NDArray[np.bool_],
    counts: NDArray[np.int64],
    shares: NDArray[np.float64],
    row: int,
    frames: int,
) -> float:
    """Median share of the beads of a species that are seen, of the worst species.

    Parameters
    ----------
    species : ndarray of int32, (n,)
    seen : ndarray of bool, (n,)
    counts : ndarray of int64, (species,)
        Beads of each species in the tray.
    shares : ndarray (memory, species)
        Of the last pictures; that of this one is written to its row.
    row, frames : int
        How many pictures there are, with this one.
    """
    shares[row] = 0.0
    for k in range(species.size):
        if seen[k]:
            shares[row, species[k]] += 1.0
    smallest = np.inf
    for k in range(counts.size):
        shares[row, k] /= counts[k]
        smallest = min(smallest, np.median(shares[:frames, k]))
    return smallest
