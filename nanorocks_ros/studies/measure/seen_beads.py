"""The beads that some frames of a film show: number, colour, a picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.tracking.scene.scene_detector import SceneDetector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_REGION, _RINGS = (0, 200, 255), ((80, 255, 120), (255, 160, 60), (200, 120, 255))
_SHIFT = 4
# Radii of a bead over which its colour is averaged.
_INNER = 0.6


class SeenBeads(NamedTuple):
    """Beads of each species in some frames.

    Parameters
    ----------
    counts : tuple of float
        Median over the frames, by species.
    steady : tuple of float
        Share of the frames with exactly that number.
    picture : ndarray of uint8, (rows, columns, 3), bgr
        The middle frame: the tray framed, beads in rings.
    discs : tuple of tuples of ndarray, (n_beads, 3), [px]
        Of each frame, by species: column and row of the centre, and radius.
    """

    counts: tuple[float, ...]
    steady: tuple[float, ...]
    picture: NDArray[np.uint8]
    discs: tuple[tuple[NDArray[np.float64], ...], ...]


def colour_at(frame: NDArray[np.uint8], place: tuple[float, float], diameter: float) -> str:
    """Colour inside a bead, as ``#rrggbb``.

    Parameters
    ----------
    frame : ndarray of uint8, (rows, columns, 3), bgr
    place : tuple of 2 floats, [px]
        Column and row of its centre.
    diameter : float, [px]

    Raises
    ------
    ConfigurationError
        When it does not lie in the picture.
    """
    height, width = frame.shape[:2]
    x, y = place
    if not (0.0 <= x < width and 0.0 <= y < height):
        raise ConfigurationError(
            '--bead', f'{x:g} {y:g} lies outside the picture of {width}x{height}', 'correct it'
        )
    mask = np.zeros((height, width), dtype=np.uint8)
    cv2.circle(mask, (round(x), round(y)), max(1, round(0.5 * _INNER * diameter)), 1, -1)
    blue, green, red = np.median(frame[mask > 0], axis=0).tolist()
    return f'#{round(red):02x}{round(green):02x}{round(blue):02x}'


def seen_beads(text: str, frames: Sequence[NDArray[np.uint8]]) -> SeenBeads:
    """Search the beads of a trays file in some frames of its film.

    Parameters
    ----------
    text : str
        Of the file, with a section ``film``.
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
        Spread over the film.

    Raises
    ------
    ConfigurationError
        When the file cannot be used.
    """
    (tray,) = load_trays(text).values()
    section = film_section(text)
    assert section is not None
    crops = [section.crop(frame) for frame in frames]
    detector = SceneDetector(tray, section.pixels_per_metre)
    detector.learn(crops)
    discs = [
        tuple(
            section.film_discs(np.column_stack([beads.positions, beads.radii]))
            for beads in detector.detect(crop)
        )
        for crop in crops
    ]
    shown = frames[len(frames) // 2].copy()
    for species, beads in enumerate(discs[len(frames) // 2]):
        _draw(shown, beads[:, :2], beads[:, 2], species)
    corners = np.rint(section.outline_px).astype(np.int32)
    cv2.polylines(shown, [corners], isClosed=True, color=_REGION, thickness=2)
    table = np.array([[len(beads) for beads in frame] for frame in discs])
    counts = np.median(table, axis=0)
    steady = (table == counts).mean(axis=0)
    return SeenBeads(tuple(counts.tolist()), tuple(steady.tolist()), shown, tuple(discs))


def _draw(
    picture: NDArray[np.uint8],
    places: NDArray[np.float64],
    radii: NDArray[np.float64],
    species: int,
) -> None:
    factor = 2**_SHIFT
    for (x, y), radius in zip(places.tolist(), radii.tolist(), strict=True):
        if math.isfinite(radius):
            centre = round(factor * (x - 0.5)), round(factor * (y - 0.5))
            colour = _RINGS[species % len(_RINGS)]
            cv2.circle(picture, centre, round(factor * radius), colour, 2, cv2.LINE_AA, _SHIFT)
