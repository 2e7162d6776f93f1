"""Check of the tray positions in a frame against the settings.

Tested by ``test/stages/preprocess/test_tray_position_check.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.experiment.view import IdentityLens
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.preprocess.scale_advice import (
    remedy_for,
    scale_of_beads,
    scale_source,
    scale_text,
)
from nanorocks_ros.stages.scale.beads_and_walls import SeenBeads, beads_around
from nanorocks_ros.stages.scale.picture_scale import around

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.settings import PipelineSettings, PreprocessSettings

# One pixel of the reduced picture is so many of the frame.
_REDUCED = 4
# Scales and shifts that are tried beside those of the settings; shifts in reduced pixels.
_SCALES = np.geomspace(0.2, 5.0, 323)
_SHIFT = 16
# Scales this close to one another are of the same trays.
_NEARLY = 0.1
# A slope is an edge when it is so many times the usual one, and so many gray levels.
_TIMES_USUAL = 3.0
_LEAST_SLOPE = 6.0
# Share of the sides that lie on edges: where the trays are certainly found, by how much the share
# of the settings must be smaller, and the largest of a single tray that is misplaced.
_FOUND = 0.65
_CLEARLY = 0.12
# Further off in scale, other rectangles are found by chance: a larger share is required.
_FAR, _FOUND_FAR = 1.35, 0.85
_ABSENT = 0.4
_AS_GOOD = 0.01
_SCALE_MATTERS = 0.02
_SHIFT_MATTERS_PX = 8.0
# Reduced pixels required around the trays, and the smallest significant difference of a size.
_ROOM, _RESOLVED = 2.0, 5.0


@compiled
def _coverage(
    across: NDArray[np.int64],
    down: NDArray[np.int64],
    boxes: NDArray[np.float64],
    scale: float,
    shift: tuple[float, float],
    shares: NDArray[np.float64],
) -> float:
    """Share of the sides of the boxes that lies on edges; `shares` gets that of each box."""
    rows, columns = down.shape[0], across.shape[1]
    total, length = 0.0, 0.0
    for k in range(boxes.shape[0]):
        x0 = int(0.5 * columns + scale * (boxes[k, 0] - 0.5 * columns) + shift[0] + 0.5)
        y0 = int(0.5 * rows + scale * (boxes[k, 1] - 0.5 * rows) + shift[1] + 0.5)
        x1, y1 = int(x0 + scale * boxes[k, 2] + 0.5), int(y0 + scale * boxes[k, 3] + 0.5)
        own = 2.0 * (x1 - x0 + y1 - y0)
        length += own
        shares[k] = 0.0
        if x0 < 0 or y0 < 0 or x1 >= columns or y1 >= rows:
            continue
        on = across[y1, x0] - across[y0, x0] + across[y1, x1] - across[y0, x1]
        on += down[y0, x1] - down[y0, x0] + down[y1, x1] - down[y1, x0]
        shares[k] = on / own
        total += on
    return total / length


@compiled
def _best(
    across: NDArray[np.int64],
    down: NDArray[np.int64],
    boxes: NDArray[np.float64],
    scales: NDArray[np.float64],
    reach: int,
    result: NDArray[np.float64],
) -> None:
    """Scale and shift at which the sides lie on edges least by chance: share, scale, shifts.

    Edges are a few pixels wide, so several are as good: the middle of these.
    """
    shares = np.empty(boxes.shape[0])
    side = 2 * reach + 1
    tried = np.empty((scales.size, side, side))
    perimeter = 2.0 * (boxes[:, 2].sum() + boxes[:, 3].sum())
    area = float(down.shape[0] * across.shape[1])
    usual = 0.5 * (across[-1].sum() + down[:, -1].sum()) / area
    chosen, highest = 0, -np.inf
    for k in range(scales.size):
        # Small boxes lie on edges by chance more often than large ones.
        weight = math.sqrt(scales[k] * perimeter)
        for i in range(side):
            for j in range(side):
                shift = (float(j - reach), float(i - reach))
                tried[k, i, j] = _coverage(across, down, boxes, scales[k], shift, shares)
                score = weight * (tried[k, i, j] - usual)
                if score > highest:
                    chosen, highest = k, score
    near = np.abs(scales / scales[chosen] - 1.0) < _NEARLY
    best, count = tried[near].max(), 0
    result[:] = 0.0
    for k in range(scales.size):
        if not near[k]:
            continue
        for i in range(side):
            for j in range(side):
                if tried[k, i, j] >= best - _AS_GOOD:
                    result[1] += scales[k]
                    result[2] += j - reach
                    result[3] += i - reach
                    count += 1
    result /= count
    result[0] = best


def _edge_sums(
    image: NDArray[np.uint8], view: View
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges across rows and columns of the reduced straight picture, summed along them."""
    rows, columns = image.shape[0] // _REDUCED, image.shape[1] // _REDUCED
    x = _REDUCED * (np.arange(columns) + 0.5)
    y = _REDUCED * (np.arange(rows) + 0.5)
    places = view.source(np.stack(np.meshgrid(x, y), axis=-1)).astype(np.float32) - 0.5
    gray = image[:, :, 0] if image.shape[2] == 1 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    # An average first: single pixels of the frame would be noise.
    smooth = cv2.blur(gray, (_REDUCED, _REDUCED)).astype(np.float32)
    small = cv2.remap(smooth, places[..., 0], places[..., 1], cv2.INTER_LINEAR)
    sums = []
    for axis in (1, 0):
        slope = np.abs(np.gradient(small, axis=axis))
        level = max(_LEAST_SLOPE, _TIMES_USUAL * float(np.median(slope)))
        # A pixel to each side: what is set may be off by that much.
        edges = cv2.dilate((slope > level).astype(np.uint8), np.ones((3, 3), np.uint8))
        front = ((1, 0), (0, 0)) if axis == 1 else ((0, 0), (1, 0))
        sums.append(np.pad(np.cumsum(edges, axis=1 - axis, dtype=np.int64), front))
    return sums[0], sums[1]


def position_problem(
    image: NDArray[np.uint8],
    view: View,
    regions: Sequence[Region],
    trays: Sequence[Tray],
    settings: PipelineSettings,
) -> tuple[str, frozenset[int]]:
    """What looks wrong with scale or regions, in one line, and the trays; '' when nothing does.

    Edges tell where the trays are clearly seen somewhere else: a picture without clear edges tells
    nothing. The edges of a single tray may be those of its rim, of the walls seen from inside or
    of a shadow, so that its beads must agree: the sides of a floor cut none of them, and they tell
    the same scale.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, channels), blue first
    view : View
    regions : sequence of Region
    trays : sequence of Tray
    settings : PipelineSettings
    """
    told = settings.preprocess
    beads = None
    if len(trays) == 1 and isinstance(view.camera, IdentityLens) and image.shape[2] == 3:
        scale = told.pixels_per_metre
        beads = beads_around(image, regions[0], trays[0], settings.tracking, scale)
    shares, best = _fit_edges(image, view, regions)
    numbers = frozenset(tray.number for tray in trays)
    if best is not None:
        text = _edge_text(image, regions, trays, settings, best, beads)
        if text:
            return text, numbers
    if beads is not None and beads.contradict(regions[0]):
        text = (
            f'{scale_source(told)} looks wrong: the sides of the floor of tray '
            f'{trays[0].number} would cut {beads.cut_by(regions[0])} beads; {remedy_for(told)}'
        )
        return text, numbers
    if best is None and shares is not None:
        return _one_tray(shares, [tray.number for tray in trays], told)
    return '', frozenset()


def _fit_edges(
    image: NDArray[np.uint8], view: View, regions: Sequence[Region]
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Shares of the sides on edges where the trays are seen at all, and a fit that is better.

    The fit is that of `_best`; None where the regions are as good.
    """
    boxes = np.array(regions, dtype=np.float64) / _REDUCED
    ends = boxes[:, :2] + boxes[:, 2:]
    room = min(boxes[:, :2].min(), (np.array(image.shape[1::-1]) / _REDUCED - ends).min())
    if room < _ROOM:
        return None, None
    across, down = _edge_sums(image, view)
    shares = np.empty(len(boxes))
    own = _coverage(across, down, boxes, 1.0, (0.0, 0.0), shares)
    best = np.empty(4)
    _best(across, down, boxes, _SCALES, _SHIFT, best)
    share, scale = float(best[0]), float(best[1])
    near = 1.0 / _FAR < scale < _FAR
    if share < (_FOUND if near else _FOUND_FAR):
        return None, None
    return shares, None if own >= share - _CLEARLY else best


def _edge_text(
    image: NDArray[np.uint8],
    regions: Sequence[Region],
    trays: Sequence[Tray],
    settings: PipelineSettings,
    best: NDArray[np.float64],
    seen: SeenBeads | None,
) -> str:
    """What looks wrong by the edges; '' where it does not matter or the beads contradict it."""
    _, scale, x, y = (float(number) for number in best)
    boxes = np.array(regions, dtype=np.float64) / _REDUCED
    extent = float(((boxes[:, :2] + boxes[:, 2:]).max(axis=0) - boxes[:, :2].min(axis=0)).max())
    told = settings.preprocess
    cut = seen is not None and seen.contradict(_floor_at(regions[0], image.shape, best))
    if abs(scale - 1.0) > max(_SCALE_MATTERS, _RESOLVED / extent):
        beads = None
        if seen is not None:
            beads = scale_of_beads(around(image, regions[0]), trays[0], settings, scale)
        # Where the sizes of the beads contradict what is told as well, edges are but inexact.
        if cut and (beads is None or beads.agrees(told.pixels_per_metre)):
            return ''
        return scale_text(told, told.pixels_per_metre * scale, beads)
    if not cut and max(abs(x), abs(y)) * _REDUCED > _SHIFT_MATTERS_PX:
        return (
            f'{scale_source(told)} looks wrong: the trays look shifted by {x * _REDUCED:.0f}, '
            f'{y * _REDUCED:.0f} px; {remedy_for(told)}'
        )
    return ''


def _floor_at(
    region: Region, shape: tuple[int, ...], best: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """The region at the scale and shift that `_best` found, [px]."""
    scale = float(best[1])
    # The middle of the picture as `_coverage` takes it.
    middle = [0.5 * _REDUCED * (side // _REDUCED) for side in shape[1::-1]]
    left, top = (
        centre + scale * (corner - centre) + _REDUCED * float(shift)
        for centre, corner, shift in zip(middle, region[:2], best[2:], strict=True)
    )
    return left, top, scale * region.width, scale * region.height


def _one_tray(
    shares: NDArray[np.float64], trays: Sequence[int], settings: PreprocessSettings
) -> tuple[str, frozenset[int]]:
    absent = [tray for tray, share in zip(trays, shares, strict=True) if share < _ABSENT]
    if not absent or 2 * len(absent) >= len(trays):
        return '', frozenset()
    names = ', '.join(str(tray) for tray in absent)
    text = (
        f'{scale_source(settings)} looks wrong for tray {names}: no walls are seen around it; '
        f'{remedy_for(settings)}'
    )
    return text, frozenset(absent)
