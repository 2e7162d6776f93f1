"""From colours to the one value of each pixel that shows the beads best, and its noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# A pixel differs from the background, or from what is around it, by so many times the noise.
_DIFFERS = 5.0
_LEAST_LEVELS = 6.0
BACKGROUND_SHARE = 0.3
"""A background is known where not more than this share of the pixels differs from it."""

# Smallest share of the pixels that has to move to tell the colours of beads.
_LEAST_MOVING = 2e-4
# Noise of a pixel is not below that of rounding.
_LEAST_NOISE = 0.3
_BLUR_PX = 0.7
# Changes that are wider are those of the light, [px].
_WIDE_PX = 65
# A median is taken of so many bytes at once, which the cache of a processor holds.
_MEDIAN_BYTES = 1_000_000
# About so many frames tell which colours move.
_FEW_FRAMES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneColours:
    """What the picture is made of without the beads.

    Parameters
    ----------
    background : ndarray of uint8, (rows, columns, 3), bgr
        Median over time.
    weights : ndarray (3,)
        Of blue, green and red, in the value that shows the beads.
    noise : float, [gray levels]
        Of this value, in a pixel.
    unrest : float, [gray levels]
        The same with slow light: what a pixel at rest differs by from the background.
    knows_background : bool
        Whether few enough pixels move to know what is behind the beads.
    """

    background: NDArray[np.uint8]
    weights: NDArray[np.float64]
    noise: float
    unrest: float
    knows_background: bool = False

    def enlarged(self, scale: int) -> SceneColours:
        """The same for pictures that are enlarged; the noise is that of their pixels."""
        if scale == 1:
            return self
        return replace(self, background=enlarged(self.background, scale))

    def picture(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The value that shows the beads best, slightly blurred, (rows, columns)."""
        # Channel by channel takes half as long as `cv2.transform`.
        blue, green, red = cv2.split(color)
        of_blue, of_green, of_red = self.weights.tolist()
        depth = cv2.CV_32F
        mixed = cv2.addWeighted(blue, of_blue, green, of_green, self._offset, dtype=depth)
        return _blurred(cv2.addWeighted(mixed, 1.0, red, of_red, 0.0, dtype=cv2.CV_8U))

    def difference(self, color: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Largest difference of a colour of each pixel from the background, slightly blurred."""
        blue, green, red = cv2.split(cv2.absdiff(color, self.background))
        return _blurred(cv2.max(cv2.max(blue, green), red))

    def moving(self, color: NDArray[np.uint8], levels: float = 0.0) -> NDArray[np.uint8]:
        """1 where a pixel differs from the background, else 0, (rows, columns).

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        levels : float, optional, [gray levels]
            Least difference; it is never below that of noise.
        """
        limit = max(_DIFFERS * self.unrest, _LEAST_LEVELS, levels)
        return np.asarray(cv2.threshold(self.difference(color), limit, 1, cv2.THRESH_BINARY)[1])

    def follow(self, color: NDArray[np.uint8]) -> None:
        """Move the background by one level towards a frame, where nothing moves."""
        if color.shape != self.background.shape:
            color = np.asarray(
                cv2.resize(color, self.background.shape[1::-1], interpolation=cv2.INTER_CUBIC)
            )
        still = cv2.bitwise_not(cv2.merge([255 * self.moving(color)] * 3))
        for function, limited in (
            (cv2.add, cv2.subtract(color, self.background)),
            (cv2.subtract, cv2.subtract(self.background, color)),
        ):
            step = cv2.min(cv2.bitwise_and(limited, still), np.ones_like(color))
            self.background[...] = function(self.background, step)

    @property
    def _offset(self) -> float:
        """What keeps the mixture of colours within 0 to 255."""
        return float(-255.0 * np.minimum(self.weights, 0.0).sum())


def enlarged(color: NDArray[np.uint8], scale: int) -> NDArray[np.uint8]:
    """A picture with so many times the rows and columns."""
    if scale == 1:
        return color
    size = color.shape[1] * scale, color.shape[0] * scale
    return np.asarray(cv2.resize(color, size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def _blurred(values: cv2.typing.MatLike) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(values, (3, 3), _BLUR_PX), dtype=np.uint8)


def scene_colours(
    frames: Sequence[NDArray[np.uint8]], colour: NDArray[np.float64] | None = None
) -> SceneColours:
    """Learn background and colours from frames spread over a film.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
    colour : ndarray (3,), bgr, [gray levels], optional
        Of the beads, where it is known.
    """
    background = _median(frames)
    noises = np.array([_noise(frames[-1][:, :, k]) for k in range(3)])
    if colour is None:
        scatter = _moving_scatter(frames, background, noises)
        scatter = _contrast_scatter(frames, noises) if scatter is None else scatter
        weights = np.linalg.eigh(scatter)[1][:, -1]
    else:
        floor = np.median(background.reshape(-1, 3), axis=0)
        weights = (colour - floor) / noises**2
        if not np.abs(weights).sum() > 0.0:
            weights = np.ones(3)
    # Positive where the picture gets brighter.
    weights = weights / np.abs(weights).sum()
    weights = weights if weights.sum() >= 0.0 or colour is not None else -weights
    mixed = frames[-1].astype(np.float32) @ weights.astype(np.float32)
    noise = _noise(mixed)
    colours = SceneColours(background=background, weights=weights, noise=noise, unrest=noise)
    share = float(np.mean([colours.moving(frame).mean() for frame in _few(frames)]))
    if len(frames) < 3 or share > BACKGROUND_SHARE:
        return colours
    # Codecs smooth what the mask sees of the noise, but not how it changes; light changes widely.
    changed = mixed - background.astype(np.float32) @ weights.astype(np.float32)
    unrest = max(colours.noise, float(np.median(np.abs(changed))) / 0.6745)
    changed -= cv2.blur(changed, (_WIDE_PX, _WIDE_PX))
    # Beads reach as far in this difference, and may make it the larger one.
    noise = max(colours.noise, min(unrest, float(np.median(np.abs(changed))) / 0.6745))
    return replace(colours, noise=noise, unrest=unrest, knows_background=True)


def _median(frames: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Median of each pixel and colour over the frames, some rows at a time."""
    background = np.empty_like(frames[0])
    rows = max(1, _MEDIAN_BYTES // (len(frames) * frames[0][0].size))
    for first in range(0, len(background), rows):
        part = [frame[first : first + rows] for frame in frames]
        background[first : first + rows] = _middle(part)
    return background


def _middle(parts: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The value in the middle of each pixel and colour, by its bits: sorting takes far longer."""
    middle = np.zeros_like(parts[0])
    counts = np.uint8 if len(parts) <= np.iinfo(np.uint8).max else np.int64
    for bit in (128, 64, 32, 16, 8, 4, 2, 1):
        least = middle | np.uint8(bit)
        below = np.zeros(middle.shape, dtype=counts)
        for part in parts:
            below += (part < least).view(np.uint8)
        middle = np.where(below <= len(parts) // 2, least, middle)
    return middle


def _few(frames: Sequence[NDArray[np.uint8]]) -> Sequence[NDArray[np.uint8]]:
    """Some of the frames, spread over the film, the last one among them."""
    return frames[::-1][:: max(1, len(frames) // _FEW_FRAMES)]


def _noise(values: NDArray[np.uint8] | NDArray[np.float32]) -> float:
    """Noise of a pixel, by Immerkaer's mask, which lines and slopes do not show in."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32)
    edges = np.abs(cv2.filter2D(values, cv2.CV_32F, mask)[1:-1, 1:-1])
    return max(float(np.median(edges)) / (6.0 * 0.6745), _LEAST_NOISE)


def _moving_scatter(
    frames: Sequence[NDArray[np.uint8]],
    background: NDArray[np.uint8],
    noise: NDArray[np.float64],
) -> NDArray[np.float64] | None:
    """Mean product of the colours in which moving pixels differ; None where hardly any moves."""
    scatter, count, total = np.zeros((3, 3)), 0, 0
    limit = np.maximum(_DIFFERS * noise, _LEAST_LEVELS).astype(np.float32)
    for frame in _few(frames):
        # Every other pixel of every other row.
        here, before = (image[::2, ::2].astype(np.float32) for image in (frame, background))
        difference = (here - before).reshape(-1, 3)
        differs = difference[(np.abs(difference) > limit).any(axis=1)].astype(np.float64)
        scatter += differs.T @ differs
        count += len(differs)
        total += len(difference)
    return scatter / count if count > _LEAST_MOVING * total else None


def _contrast_scatter(
    frames: Sequence[NDArray[np.uint8]], noise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The same of pixels against their wider surroundings."""
    frame = frames[-1].astype(np.float32)
    wide = 2 * math.ceil(0.05 * min(frame.shape[:2])) + 1
    difference = (frame - cv2.blur(frame, (wide, wide))).reshape(-1, 3).astype(np.float64)
    differs = difference[(np.abs(difference) > _DIFFERS * noise).any(axis=1)]
    if len(differs) == 0:
        return np.eye(3)
    return np.asarray(differs.T @ differs / len(differs))
