"""Edges of the trays in a picture, to a fraction of a pixel.

Tested by ``test/studies/calibration/test_plate_fit.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Place across a side [px], strength [gray levels/px] and sign of an edge.
Peak = tuple[float, float, float]
Mapping = Callable[['NDArray[np.float64]', int], 'NDArray[np.float64]']

# Along a side, from one place to the next, [px]; the corners are left out, as a share of it.
_SPACING_PX = 8.0
_CORNER = 0.08
# Pixels to each side along the edge that are averaged, and step across it.
_ALONG = 3
_STEP = 0.5
# Least slope of an edge, in units of what noise gives.
_CLEAR = 2.0
_LEAST_SLOPE = 1.5
# Places of a side agree so nearly, [px].
_NEAR = 2.5
# Edges that count, as a share of the strongest; widths of walls, [px] and [m].
_AS_STRONG = 0.2
_NARROWEST_WALL, _WIDEST_WALL = 2.5, 1.9e-3
_OFF = 3.0
_WALL_SPREAD = 0.8


@dataclass(frozen=True, slots=True)
class Edges:
    """Places along the edges of the trays, and where they are in the picture.

    Parameters
    ----------
    trays : ndarray of int, (n,)
        Numbers of the trays.
    sides : ndarray of int, (n,)
        0 left, 1 right, 2 upper, 3 lower.
    places : ndarray, (n, 2)
        On the side, as shares of its tray's width and height.
    found : ndarray, (n, 2), [px]
        In the picture.
    normals : ndarray, (n, 2)
        Unit vectors across the side, outwards, in the picture.
    wall_px : float, [px]
        Width of the walls, whose outer edges were found; 0 where there is one edge only, NaN
        where nobody looked.
    expected : int
        Places that were looked at.
    """

    trays: NDArray[np.int64]
    sides: NDArray[np.int64]
    places: NDArray[np.float64]
    found: NDArray[np.float64]
    normals: NDArray[np.float64]
    wall_px: float
    expected: int


def _sides(tray: Tray, spacing: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Places along the four sides of a floor, as shares of its width and height."""
    sides, places = [], []
    for side in range(4):
        length = tray.dimensions[1 if side < 2 else 0]
        count = max(3, int(length * (1.0 - 2.0 * _CORNER) / spacing))
        along = np.linspace(_CORNER, 1.0 - _CORNER, count)
        fixed = np.full(count, float(side % 2))
        places.append(np.stack([fixed, along] if side < 2 else [along, fixed], axis=-1))
        sides.append(np.full(count, side))
    return np.concatenate(sides), np.concatenate(places)


_OUTWARD = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])


def find_edges(
    gray: NDArray[np.float32],
    trays: Sequence[Tray],
    to_picture: Mapping,
    pixels_per_metre: float,
    reach: float,
    *,
    walls: bool,
) -> Edges:
    """Look for the edges of the trays next to where they should be.

    Parameters
    ----------
    gray : ndarray of float32, (rows, columns)
    trays : sequence of Tray
    to_picture : callable
        Takes shares of a floor, (n, 2), and the number of a tray, gives pixels, (n, 2).
    pixels_per_metre : float, [px/m]
        About.
    reach : float, [px]
        To each side of where the edge should be.
    walls : bool
        Whether the outer edges of the walls are told from the inner ones, and from what lies on
        the floor; for that they have to be where they should to a few pixels.
    """
    smooth = np.asarray(cv2.GaussianBlur(gray, (0, 0), 0.8), dtype=np.float32)
    looks = [_look(smooth, tray, to_picture, pixels_per_metre, reach) for tray in trays]
    wall, anchors = _walls(looks) if walls else (math.nan, {})
    parts = []
    for look in looks:
        offsets, good = np.empty(len(look.at)), np.zeros(len(look.at), dtype=bool)
        for side in range(4):
            own = look.sides == side
            anchor = anchors.get((look.tray, side))
            if walls and anchor is None:
                continue
            offsets[own], good[own] = _offsets(look.across, look.slope[own], reach, anchor)
        good &= (look.at > reach).all(axis=1)
        good &= (look.at < np.array(gray.shape[::-1]) - reach).all(axis=1)
        found = look.at + offsets[:, np.newaxis] * look.normals
        numbers = np.full(int(good.sum()), look.tray)
        parts.append(
            (numbers, look.sides[good], look.places[good], found[good], look.normals[good])
        )
    columns = [np.concatenate(part) for part in zip(*parts, strict=True)]
    expected = sum(len(look.sides) for look in looks)
    return Edges(columns[0], columns[1], columns[2], columns[3], columns[4], wall, expected)


@dataclass(frozen=True, slots=True)
class _Look:
    """Slopes across the sides of one tray."""

    tray: int
    sides: NDArray[np.int64]
    places: NDArray[np.float64]
    at: NDArray[np.float64]
    normals: NDArray[np.float64]
    across: NDArray[np.float64]
    slope: NDArray[np.float64]


def _look(
    gray: NDArray[np.float32], tray: Tray, to_picture: Mapping, scale: float, reach: float
) -> _Look:
    sides, places = _sides(tray, _SPACING_PX / scale)
    at = to_picture(places, tray.number)
    # A thousandth of the floor outwards.
    normals = to_picture(places + 1e-3 * _OUTWARD[sides], tray.number) - at
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    across, slope = _slopes(gray, at, normals, max(reach, _WIDEST_WALL * scale))
    return _Look(tray.number, sides, places, at, normals, across, slope)


def _walls(looks: Sequence[_Look]) -> tuple[float, dict[tuple[int, int], float]]:
    """Width of the walls in the picture, and where the outer edge of each side is, [px].

    A wall is darker or brighter than the floor and the plate, so it has two edges of opposite
    slopes, and all walls are equally wide. Where most sides show one edge only there is no wall.
    """
    peaks = {
        (look.tray, side): _peaks(look.across, np.median(look.slope[look.sides == side], axis=0))
        for look in looks
        for side in range(4)
    }
    pairs = {key: _pairs(edges) for key, edges in peaks.items()}
    widths = np.array([b[0] - a[0] for edge_pairs in pairs.values() for a, b in edge_pairs])
    width = 0.0
    if widths.size:
        support = (np.abs(widths[:, np.newaxis] - widths) < _WALL_SPREAD).sum(axis=1)
        if support.max() >= 0.5 * len(peaks):
            like = np.abs(widths - widths[support.argmax()]) < _WALL_SPREAD
            width = float(np.median(widths[like]))
    anchors = {}
    for key, edges in peaks.items():
        if width > 0.0:
            fitting = [pair for pair in pairs[key] if abs(pair[1][0] - pair[0][0] - width) < 1.5]
            best = max(fitting, key=_likelihood, default=None)
            if best is not None:
                anchors[key] = best[1][0]
        elif edges:
            anchors[key] = max(edges, key=lambda peak: peak[1] / (1.0 + abs(peak[0])))[0]
    return width, anchors


def _likelihood(pair: tuple[Peak, Peak]) -> float:
    """Of two edges that make a wall: strong, and one of them near where the edge should be.

    The wall of the next tray looks the same.
    """
    inner, outer = pair
    off = min(abs(inner[0]), abs(outer[0])) / _OFF
    return min(inner[1], outer[1]) * math.exp(-0.5 * off * off)


def _peaks(across: NDArray[np.float64], slope: NDArray[np.float64]) -> list[Peak]:
    """Place, strength and sign of the edges across a side."""
    strength = np.abs(slope)
    top = (strength[1:-1] > strength[:-2]) & (strength[1:-1] >= strength[2:])
    top &= strength[1:-1] >= max(_LEAST_SLOPE, _AS_STRONG * float(strength.max()))
    return [
        (float(across[k]), float(strength[k]), float(np.sign(slope[k])))
        for k in np.flatnonzero(top) + 1
    ]


def _pairs(
    peaks: list[Peak],
) -> list[tuple[Peak, Peak]]:
    return [(a, b) for a in peaks for b in peaks if b[0] - a[0] > _NARROWEST_WALL and a[2] != b[2]]


def _slopes(
    gray: NDArray[np.float32], at: NDArray[np.float64], normals: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slope of the levels along each normal, outwards, [gray levels/px]."""
    across = np.arange(-reach - 2.0, reach + 2.0 + 0.5 * _STEP, _STEP)
    along = np.arange(-_ALONG, _ALONG + 1.0)
    tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=-1)
    points = (
        at[:, np.newaxis, np.newaxis]
        + across[:, np.newaxis, np.newaxis] * normals[:, np.newaxis, np.newaxis]
        + along[:, np.newaxis] * tangents[:, np.newaxis, np.newaxis]
    ).astype(np.float32) - np.float32(0.5)
    flat = points.reshape(len(at), -1, 2)
    levels = cv2.remap(
        gray, flat[..., 0], flat[..., 1], cv2.INTER_CUBIC, None, cv2.BORDER_REPLICATE
    )
    profile = levels.reshape(points.shape[:3]).mean(axis=2)
    return across, np.gradient(profile, _STEP, axis=1)


def _offsets(
    across: NDArray[np.float64], slope: NDArray[np.float64], reach: float, anchor: float | None
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """How far along each normal of a side its edge is, and whether it is an edge."""
    if anchor is None:
        # An edge nearer to its expected position is more likely.
        signed = np.abs(slope) * np.exp(-0.5 * (across / (0.7 * reach)) ** 2)
        signed = signed * (np.abs(across) <= reach)
    else:
        middle = np.median(slope[:, int(np.abs(across - anchor).argmin())])
        signed = np.sign(middle) * slope * (np.abs(across - anchor) <= _NEAR)
    best = np.clip(signed.argmax(axis=1), 1, across.size - 2)
    rows = np.arange(len(slope))
    left, top, right = (np.abs(slope[rows, best + k]) for k in (-1, 0, 1))
    bend = np.minimum(left - 2.0 * top + right, -1e-9)
    peak = np.clip(0.5 * (left - right) / bend, -1.0, 1.0)
    noise = np.median(np.abs(slope), axis=1)
    good = (signed[rows, best] > 0.0) & (top > np.maximum(_LEAST_SLOPE, _CLEAR * noise))
    return across[best] + peak * _STEP, good
