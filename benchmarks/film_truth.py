"""Films in video files with the truth beside them: drawn ones, and those made by other code."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    PowerLawRestitution,
    compiled_law,
    restitution_at,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

DEFAULT_SCALE = 13.5
"""Scale of films that state none, [px/mm]."""
_PER_METRE = 1000.0
# Frames in which it is looked which beads show, and places in a disc of radius 1, (points, 2).
_LOOKS = 60
_HALF = 0.5
_GRID = np.linspace(-0.95, 0.95, 12)
_DISC = np.array([(x, y) for x in _GRID for y in _GRID if x**2 + y**2 < 1.0])


@dataclass(frozen=True, kw_only=True)
class FilmTruth:
    """A film of one tray and its truth.

    Parameters
    ----------
    video : Path
    tray : int
    beads, walls : float
        Restitutions; NaN where one number does not describe them.
    sticking : float, [m/s]
        Beads stick below this normal speed; 0: never.
    law : PowerLawRestitution or None
        Of the beads, where their restitution depends on speed by a power that is known.
    frame_rate : float, [1/s]
    shake : float, [s]
        Time of the kick.
    scale : float, [px/m]
    camera_height : float, [m]
        Above the floor; infinite without perspective.
    region : tuple of 4 floats or empty, [px]
        Left, top, width and height of the floor; empty: in the middle of the picture.
    positions : ndarray (frames, beads, 2), [m]
        From the corner of the floor, where it is then.
    velocities : ndarray (frames, beads, 2), [m/s]
        In space, as speeds are measured: a plate that swings does not move the beads above it.
    heights : ndarray (frames, beads), [m]
        Above the floor.
    vertical_velocities : ndarray (frames, beads), [m/s]
    radii : ndarray (beads,), [m]
    species : ndarray of int, (beads,)
    merges : ndarray (merges,), [s]
        Times since the kick.
    """

    video: Path
    tray: int
    beads: float
    walls: float
    sticking: float
    law: PowerLawRestitution | None
    frame_rate: float
    shake: float
    scale: float
    camera_height: float
    region: tuple[float, ...]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    heights: NDArray[np.float64]
    vertical_velocities: NDArray[np.float64]
    radii: NDArray[np.float64]
    species: NDArray[np.int64]
    merges: NDArray[np.float64]

    def restitution_at(self, speed: float) -> float:
        """Restitution of beads that meet with a normal speed, [m/s]."""
        if self.law is None:
            return self.beads
        return float(restitution_at(*compiled_law('beads', self.law), speed))

    @cached_property
    def magnification(self) -> NDArray[np.float64]:
        """Size of each bead in the picture over that on the floor, (frames, beads)."""
        return 1.0 / (1.0 - self.heights / self.camera_height)

    @cached_property
    def visible(self) -> NDArray[np.float64]:
        """Beads of each species that others do not hide to more than half, mean over time."""
        step = max(len(self.positions) // _LOOKS, 1)
        frames = range(0, len(self.positions), step)
        counts = [
            np.bincount(self.species[self._shown(frame)], minlength=self.species.max() + 1)
            for frame in frames
        ]
        mean: NDArray[np.float64] = np.mean(counts, axis=0)
        return mean

    def _shown(self, frame: int) -> NDArray[np.bool_]:
        """Whether at most half of each bead is behind beads nearer to the camera, (beads,)."""
        positions, heights = self.positions[frame], self.heights[frame]
        points = positions[:, np.newaxis] + self.radii[:, np.newaxis, np.newaxis] * _DISC
        hidden = np.zeros(points.shape[:2], dtype=bool)
        pairs = cKDTree(positions).query_pairs(2.0 * self.radii.max(), output_type='ndarray')
        for below, above in np.concatenate([pairs, pairs[:, ::-1]]).tolist():
            if heights[above] > heights[below]:
                apart = np.hypot(*(points[below] - positions[above]).T)
                hidden[below] |= apart < self.radii[above]
        shown: NDArray[np.bool_] = hidden.mean(axis=1) <= _HALF
        return shown

    @cached_property
    def mean_projected_speed(self) -> NDArray[np.float64]:
        """Mean speed in the image plane in each frame, (frames,), [m/s]."""
        speeds = np.hypot(*np.moveaxis(self.velocities, -1, 0))
        mean: NDArray[np.float64] = speeds.mean(axis=1)
        return mean


def read_truth(video: Path) -> FilmTruth:
    """Read the truth that lies beside a video as ``.npz``.

    Raises
    ------
    OSError
        Where it cannot be read.
    """
    with np.load(video.with_suffix('.npz')) as archive:
        arrays = dict(archive)
    asked, scale, region = _asked(arrays)
    height = _camera_height(arrays)
    rate = float(arrays['fps'])
    displacement = arrays['D'].astype(np.float64)
    law = _law(arrays)
    spread = law or any(asked.get(name) for name in ('va', 'vb'))
    return FilmTruth(
        video=video,
        tray=int(arrays['tray']),
        beads=float('nan') if spread else float(asked['eps']),
        walls=float(asked['epsw']),
        sticking=float(asked.get('vstick', 0.0)),
        law=law,
        frame_rate=rate,
        shake=float(arrays['pre']),
        scale=scale,
        camera_height=height,
        region=region,
        positions=arrays['P'][..., :2].astype(np.float64) - displacement[:, np.newaxis],
        velocities=arrays['V'][..., :2].astype(np.float64),
        heights=arrays['P'][..., 2].astype(np.float64),
        vertical_velocities=arrays['V'][..., 2].astype(np.float64),
        radii=arrays['rad'].astype(np.float64),
        species=arrays['sp'].astype(np.int64),
        merges=np.asarray(arrays['merges'], dtype=np.float64).reshape(-1, 3)[:, 0],
    )


def _law(arrays: dict[str, NDArray[np.generic]]) -> PowerLawRestitution | None:
    """By which power of the speed beads of a drawn film lose; None where they are constant."""
    simulation = json.loads(str(arrays['settings']))['simulation'] if 'settings' in arrays else {}
    if simulation.get('restitution_law') != 'power':
        return None
    return PowerLawRestitution(
        value=float(simulation['restitution']),
        at_speed=float(simulation['restitution_speed']),
        exponent=float(simulation['restitution_exponent']),
    )


def _camera_height(arrays: dict[str, NDArray[np.generic]]) -> float:
    """Height of the camera above the floor, [m]."""
    scene = json.loads(str(arrays['settings']))['scene'] if 'settings' in arrays else {}
    return float(scene.get('camera_height', 0.0)) or float('inf')


def _asked(
    arrays: dict[str, NDArray[np.generic]],
) -> tuple[dict[str, float], float, tuple[float, ...]]:
    """What engine and renderer were asked for, scale [px/m], and region of the floor [px]."""
    if 'settings' not in arrays:
        asked, drawn = (json.loads(str(arrays[name])) for name in ('sim', 'px'))
        return asked, _PER_METRE * float(drawn.get('s', DEFAULT_SCALE)), ()
    simulation = json.loads(str(arrays['settings']))['simulation']
    names = {'restitution': 'eps', 'wall_restitution': 'epsw', 'sticking_speed': 'vstick'}
    asked = {short: float(simulation[name]) for name, short in names.items()}
    region = tuple(float(side) for side in np.asarray(arrays['region'], dtype=np.float64))
    return asked, float(np.asarray(arrays['scale'], dtype=np.float64)), region
