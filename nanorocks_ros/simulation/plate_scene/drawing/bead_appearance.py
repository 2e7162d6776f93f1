"""Appearance of the bodies of a tray: colour, shape, orientation, dust; drawn once per body.

Tested by ``test/simulation/plate_scene/test_plate_film.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.initial_state import inventory
from nanorocks_ros.simulation.plate_scene.drawing.grains import FACETS, LOBES, SHAPE
from nanorocks_ros.simulation.plate_scene.drawing.scene_bodies import GRAIN, SPHERE
from nanorocks_ros.simulation.tray_camera.appearance_rows import look_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings

_SHAPES = 97
# Columns of a look, as the fields of experiment.materials.Look.
_AMBIENT, _DIFFUSE, _DARKENING, _GLOW, _SHEEN, _HIGHLIGHT = range(3, 9)
# Spread of brightness from bead to bead, and from facet to facet of a grain.
_SPREAD, _MINERALS = 0.06, 0.22
# The turning of beads dies away as their speeds do, with this time [s].
_COOLING = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """Appearance of the bodies of one tray, one row for each.

    Parameters
    ----------
    looks : ndarray (n, 9)
        Columns as the fields of `Look`.
    kinds : ndarray of int64, (n,)
        `SPHERE` or `GRAIN`.
    stretch : ndarray (n,)
        Square root of the ratio of the axes.
    angles, rates : ndarray (n,), [rad], [rad/s]
        Orientation at the start, and angular speed right after shaking.
    dust : ndarray (n,)
        Dust on the bead, 0 to 2.
    """

    looks: NDArray[np.float64]
    kinds: NDArray[np.int64]
    stretch: NDArray[np.float64]
    angles: NDArray[np.float64]
    rates: NDArray[np.float64]
    dust: NDArray[np.float64]

    @staticmethod
    def joined(parts: list[Appearance]) -> Appearance:
        """Appearance of several trays, one after the other."""
        first = parts or [_NOTHING]
        names = [field.name for field in fields(Appearance)]
        return Appearance(
            **{
                name: np.concatenate([getattr(appearance, name) for appearance in first])
                for name in names
            }
        )


_NOTHING = Appearance(
    looks=np.empty((0, 9)),
    kinds=np.empty(0, dtype=np.int64),
    stretch=np.empty(0),
    angles=np.empty(0),
    rates=np.empty(0),
    dust=np.empty(0),
)


def appearance_of(tray: Tray, scene: SceneSettings, rng: np.random.Generator) -> Appearance:
    """Draw the appearance of the bodies of a tray at random."""
    drawn = inventory(tray)
    n = len(drawn.materials)
    # All numbers are drawn, used or not, so that an effect that is off does not change the others.
    brightness = 1.0 + _SPREAD * rng.standard_normal(n)
    ratio = 1.0 + scene.ovality * np.abs(rng.standard_normal(n))
    angles = rng.uniform(0.0, 2.0 * math.pi, n)
    rates = scene.turning * rng.standard_normal(n)
    dust = 0.55 + 0.9 * rng.random(n)
    materials = [tray.materials[name] for name in drawn.materials]
    looks = look_rows(materials)
    looks[:, :3] *= np.maximum(brightness, 0.5)[:, np.newaxis]
    _shade(looks, scene)
    is_oval = np.array([material.shape == 'oval' for material in materials])
    is_grain = np.array([material.shape == 'grain' for material in materials])
    return Appearance(
        looks=looks,
        kinds=np.where(is_grain, GRAIN, SPHERE).astype(np.int64),
        stretch=np.where(is_oval, np.sqrt(np.minimum(ratio, 1.8)), 1.0),
        angles=angles,
        rates=rates,
        dust=dust * (scene.chalk if tray.chalk else 0.0),
    )


def _shade(looks: NDArray[np.float64], scene: SceneSettings) -> None:
    """Scale shading and highlights by the settings, in place."""
    flat = 1.0 - scene.shading
    # In the mean over a disc this is as bright as the shaded sphere, nearly.
    looks[:, _AMBIENT] += flat * 0.6 * looks[:, _DIFFUSE]
    for column in (_DIFFUSE, _DARKENING, _GLOW, _SHEEN):
        looks[:, column] *= scene.shading
    looks[:, _SHEEN] *= min(scene.highlights, 1.0)
    looks[:, _HIGHLIGHT] *= scene.highlights


def turned_angle(time: float, events: list[float]) -> float:
    """Angle by which a body with an initial rate of 1 rad/s has turned, [rad].

    Parameters
    ----------
    time : float, [s]
    events : list of float, [s]
        Shaking events so far.
    """
    ends = [*events[1:], time]
    return sum(
        _COOLING * math.log1p((end - start) / _COOLING)
        for start, end in zip(events, ends[: len(events)], strict=True)
    )


def grain_shapes(irregularity: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Outlines and facets of grains, see `grains.SHAPE`; every outline has the area of a disc.

    Parameters
    ----------
    irregularity : float
        Spread of the outline, in radii.
    rng : Generator

    Returns
    -------
    ndarray (97, SHAPE)
    """
    shapes = np.zeros((_SHAPES, SHAPE))
    # The lobes of lowest order are the largest: chips rather than stars.
    weights = np.repeat([0.75, 0.5, 0.43], 2)
    lobes = irregularity * weights * rng.standard_normal((_SHAPES, LOBES))
    lobes = np.clip(lobes, -1.6 * irregularity, 1.6 * irregularity)
    shapes[:, :LOBES] = lobes
    facets = rng.standard_normal((_SHAPES, FACETS, 3))
    facets[..., 2] = np.abs(facets[..., 2]) + 0.35
    facets /= np.linalg.norm(facets, axis=2)[..., np.newaxis]
    minerals = np.maximum(1.0 + _MINERALS * rng.standard_normal((_SHAPES, FACETS, 1)), 0.4)
    shapes[:, LOBES:] = np.concatenate([facets, minerals], axis=2).reshape(_SHAPES, -1)
    return shapes


def outline_moments(
    lobes: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Area, centroid and extent of the outlines of grains of mean radius 1.

    Parameters
    ----------
    lobes : ndarray (n, 6)

    Returns
    -------
    size : ndarray (n,)
        Radius of the disc of the same area.
    centroid : ndarray (n, 2)
    furthest : ndarray (n,)
        Largest distance from the origin.
    """
    angle = np.linspace(0.0, 2.0 * math.pi, 360, endpoint=False)
    waves = np.stack([f(k * angle) for k in (2, 3, 4) for f in (np.cos, np.sin)])
    radius = 1.0 + lobes @ waves
    area = np.mean(radius**2, axis=1)
    unit = np.stack([np.cos(angle), np.sin(angle)])
    # Of a sector, the centroid lies at two thirds of the radius.
    centroid = (2.0 / 3.0) * np.mean(radius[:, np.newaxis] ** 3 * unit, axis=2) / area[:, None]
    return np.sqrt(area), centroid, radius.max(axis=1)
