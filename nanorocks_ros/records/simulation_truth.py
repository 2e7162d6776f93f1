"""True values of simulated frames.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records.quality_flags import freeze_arrays

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundTruth:
    """True values of a simulated frame.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    mean_projected_speed, mean_speed : float, [m/s]
    bodies : int
        Free bodies: beads and aggregates.
    restitution, wall_restitution : float
    sticking_speed : float, [m/s]
        0 when nothing sticks.
    """

    stamp_ns: int
    tray: int
    cycle: int
    mean_projected_speed: float
    mean_speed: float
    bodies: int
    restitution: float
    wall_restitution: float
    sticking_speed: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BeadsTruth:
    """True values of every bead of a tray in a simulated frame.

    Relative to the floor of the tray, as after registration of the tray in every image. The
    tray oscillates; free beads fly straight past the camera.

    Parameters
    ----------
    stamp_ns : int
    tray, cycle : int
    displacement : ndarray (2,), [m]
        Of the tray from its place at rest, along columns and rows.
    tray_velocity : ndarray (2,), [m/s]
    positions : ndarray (n, 3), [m]
        From the corner of the floor where it is now; z towards the camera.
    velocities : ndarray (n, 3), [m/s]
        Relative to the tray.
    radii : ndarray (n,), [m]
    species : ndarray of int32, (n,)
        Place of the species in `Tray.species`.
    bodies : ndarray of int32, (n,)
        The smallest number of a bead in the body that each bead belongs to. A bead's number,
        its identity, is its row.
    """

    stamp_ns: int
    tray: int
    cycle: int
    displacement: NDArray[np.float64]
    tray_velocity: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    radii: NDArray[np.float64]
    species: NDArray[np.int32]
    bodies: NDArray[np.int32]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def ids(self) -> NDArray[np.int32]:
        """Number of each bead, (n,)."""
        return np.arange(len(self.radii), dtype=np.int32)

    @property
    def free_velocities(self) -> NDArray[np.float64]:
        """Velocities past the camera, (n, 3), [m/s]: constant between collisions."""
        return np.asarray(self.velocities + np.append(self.tray_velocity, 0.0))

    @property
    def projected_speeds(self) -> NDArray[np.float64]:
        """Speeds in the image plane past the camera, (n,), [m/s]."""
        return np.asarray(np.hypot(*self.free_velocities[:, :2].T))
