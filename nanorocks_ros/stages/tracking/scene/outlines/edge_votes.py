"""Votes of edges for the centres of discs: each edge points along its gradient to the centre."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_kernels import add_votes, find_peaks

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Radius to which the picture is reduced for the votes, [px].
_VOTING_RADIUS_PX = 8.0
# Blur before the gradient: share of the radius, and limits, [px].
_BLUR_SHARE, _BLUR_PX = 0.1, (0.6, 1.2)
# Votes within this part of the radius, and at least so many pixels, are those of one centre.
_SPREAD_SHARE, _SPREAD_PX = 0.1, 0.8
# Centres are at least this many radii apart.
_APART_RADII = 0.7
# Gradient of an edge in noise of the blurred picture.
_NOISE_FACTOR = 4.0


# Largest ratio of the radii that are searched at once, as a logarithm.
_MAX_LOG_RANGE = math.log(1.7)


class Voting(NamedTuple):
    """What edges vote for.

    Parameters
    ----------
    smallest, largest : float, [px]
        Radii.
    sign : int
        1: discs are brighter than what is around them, -1: darker, 0: either.
    step : float
        Usual step of the picture at the edge of a disc.
    noise : float
        Of a pixel.
    outline : tuple of floats, (RAYS,)
        Where light and shade let the outline of a bead show on each ray, in radii; none: on the
        circle.
    """

    smallest: float
    largest: float
    sign: int
    step: float
    noise: float
    outline: tuple[float, ...] = ()


def centres_of_all_sizes(
    picture: NDArray[np.uint8], voting: Voting, least: float
) -> NDArray[np.float64]:
    """As `find_centres`, for any range of radii: it is searched in parts."""
    parts = max(1, math.ceil(math.log(voting.largest / voting.smallest) / _MAX_LOG_RANGE))
    limits = np.geomspace(voting.smallest, voting.largest, parts + 1)
    return np.concatenate(
        [
            find_centres(picture, voting._replace(smallest=low, largest=high), least)
            for low, high in zip(limits[:-1].tolist(), limits[1:].tolist(), strict=True)
        ]
    )


def find_centres(picture: NDArray[np.uint8], voting: Voting, least: float) -> NDArray[np.float64]:
    """Places where discs may be.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
    voting : Voting
    least : float
        Smallest share of an outline that has to vote for a centre.

    Returns
    -------
    ndarray (n, 4)
        Column and row, where the first pixel is 0, and radius, [px]; share of the outline that
        votes. The most likely ones first.
    """
    middle = math.sqrt(voting.smallest * voting.largest)
    scale = min(1.0, _VOTING_RADIUS_PX / middle)
    if scale < 1.0:
        picture = _reduced(picture, scale)
    votes = _votes(picture, scale, voting)
    centres = _peaks(votes, max(1.0, _APART_RADII * voting.smallest * scale), least)
    centres[:, :2] = (centres[:, :2] + 0.5) / scale - 0.5
    return np.insert(centres, 2, middle, axis=1)


def _reduced(picture: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """A smaller picture: halved as often as it can be, then interpolated.

    Means of areas that are not whole pixels take eight times as long.
    """
    while scale <= 0.5:
        half = cv2.resize(picture, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
        picture = np.asarray(half)
        scale *= 2.0
    return np.asarray(
        cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    )


def _votes(picture: NDArray[np.uint8], scale: float, voting: Voting) -> NDArray[np.float32]:
    """Share of an outline around each pixel that votes for it."""
    low, high = voting.smallest * scale, voting.largest * scale
    middle = math.sqrt(low * high)
    blur = min(max(_BLUR_SHARE * middle, _BLUR_PX[0]), _BLUR_PX[1])
    smooth = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), blur)
    across = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, scale=0.125), dtype=np.float32)
    down = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1, scale=0.125), dtype=np.float32)
    size = np.asarray(cv2.magnitude(across, down), dtype=np.float32)
    # Noise of the gradient of a blurred picture; a reduced one has less.
    noise = voting.noise * scale * 0.28 / max(blur, 0.5) ** 2
    cap = voting.step / (2.5 * math.hypot(blur, 0.7))
    radii = np.linspace(low, high, max(1, math.ceil(high - low) + 1)).astype(np.float32)
    signs = (1, -1) if voting.sign == 0 else (voting.sign,)
    votes = np.zeros(picture.shape, dtype=np.float32)
    least = np.float32(max(_NOISE_FACTOR * noise, 0.2 * cap))
    limits = least, np.float32(cap), np.float32(1.0 / voting.step)
    for sign in signs:
        add_votes(across, down, size, np.float32(sign) * radii, limits, votes)
    spread = max(_SPREAD_PX, _SPREAD_SHARE * middle)
    collected = cv2.GaussianBlur(votes, (0, 0), spread)
    # The sum of the votes within the spread, over the number of pixels of an outline.
    factor = 4.0 * math.pi * spread**2 / (2.0 * math.pi * middle)
    return np.asarray(collected * factor, dtype=np.float32)


def _peaks(votes: NDArray[np.float32], apart: float, least: float) -> NDArray[np.float64]:
    """Column, row and votes of the largest votes within a distance, largest first."""
    reach = math.ceil(apart)
    shape = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    near = np.argwhere(shape) - reach
    # The nearest ones first: most places have a neighbour with more votes.
    near = np.ascontiguousarray(near[np.argsort((near**2).sum(axis=1), kind='stable')])
    peaks = np.empty((votes.size // 2 + 1, 3))
    peaks = peaks[: find_peaks(votes, near, np.float32(least), peaks)]
    return np.asarray(peaks[np.argsort(-peaks[:, 2], kind='stable')])
