"""Tracked beads of one tray image.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records.quality_flags import NOTHING_WRONG, Quality, freeze_arrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

BEAD_FIELDS = (
    'ids',
    'species',
    'positions',
    'position_errors',
    'velocities',
    'velocity_errors',
    'radii',
    'radius_errors',
    'seen',
)
"""Fields of `Tracks` with an entry for each bead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """The beads of one tray in one image; each keeps its number.

    Parameters
    ----------
    stamp_ns : int
    tray : int
    ids : ndarray of int32, (n,)
        Numbers of the tracks, rising; a bead lost for too long comes back under a new one.
    species : ndarray of int32, (n,)
        Index into the species of the tray.
    displacement : ndarray (2,), [m]
        Of the tray in space, from where it was at first; 0 where nobody measured it, and where
        the camera moves, not the tray.
    positions : ndarray (n, 2), [m]
        Of the centres, from the corner of the floor where it is now; along columns and rows.
    position_errors : ndarray (n,), [m]
        Standard error of a coordinate about a shift that all beads of a species have in common,
        from the direction of the light: it changes neither speeds nor distances within a species.
    velocities : ndarray (n, 2), [m/s]
        Past the camera, not the swinging tray, at the instant of the picture; NaN when unknown.
    velocity_errors : ndarray (n,), [m/s]
        Standard error of a component; NaN when unknown.
    radii, radius_errors : ndarray (n,), [m]
    seen : ndarray of bool, (n,)
        False where the bead is hidden and its place is predicted.
    expected : ndarray of int32, (species,)
        Beads of each species that the tray should show; 0 where any number may be there.
    quality : Quality
        That of the image, and FEW_BEADS where much of a species is not seen.
    cycle : int
        Number of shaking events before the image.
    """

    stamp_ns: int
    tray: int
    ids: NDArray[np.int32]
    species: NDArray[np.int32]
    displacement: NDArray[np.float64]
    positions: NDArray[np.float64]
    position_errors: NDArray[np.float64]
    velocities: NDArray[np.float64]
    velocity_errors: NDArray[np.float64]
    radii: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    seen: NDArray[np.bool_]
    expected: NDArray[np.int32]
    quality: Quality = NOTHING_WRONG
    cycle: int = 0

    def __post_init__(self) -> None:
        freeze_arrays(self)
