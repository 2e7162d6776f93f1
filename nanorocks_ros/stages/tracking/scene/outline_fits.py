"""Circles fitted to the edges along rays from the centres of discs, many discs at once."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.edge_votes import Voting

_RAYS = 24
# Part of the radius on either side of the outline that is searched for edges, by iteration.
_REACHES = 0.5, 0.25
_LEAST_REACH_PX = 1.5
# Samples along a ray are this far apart at least, [px], and so many at most.
_SAMPLE_PX, _MAX_SAMPLES = 0.5, 24
# Smallest step of an edge over the usual one, and over the noise.
_LEAST_STEP, _LEAST_NOISES = 0.25, 3.0
# Edges this far from the circle do not count: part of the radius, and at least, [px].
_OFF_SHARE, _OFF_PX = 0.12, 0.8
# Smallest scatter of an edge, [px], and edges that tell a circle.
_LEAST_SCATTER_PX, _LEAST_EDGES = 0.08, 6
# Neighbouring rays share pixels.
_CORRELATION_FACTOR = 1.6


class Outlines(NamedTuple):
    """Fitted circles.

    Parameters
    ----------
    discs : ndarray (n, 3), [px]
        Column, row, where the first pixel is 0, and radius.
    errors, radius_errors : ndarrays (n,), [px]
        Standard errors of a coordinate and of the radius.
    support : ndarray (n,)
        Share of the rays whose edge lies on the circle.
    steps : ndarray (n,)
        Mean step of the picture from outside to inside.
    """

    discs: NDArray[np.float64]
    errors: NDArray[np.float64]
    radius_errors: NDArray[np.float64]
    support: NDArray[np.float64]
    steps: NDArray[np.float64]

    def chosen(self, rows: NDArray[np.bool_]) -> Outlines:
        """Some of the circles."""
        return Outlines(*(values[rows] for values in self))


def fit_outlines(
    picture: NDArray[np.uint8], discs: NDArray[np.float64], voting: Voting
) -> Outlines:
    """Fit a circle to each disc.

    Parameters
    ----------
    picture : ndarray of uint8, (rows, columns)
        Slightly blurred.
    discs : ndarray (n, 3), [px]
        Where to begin: column, row, radius.
    voting : Voting
    """
    discs = discs.copy()
    angles = 2.0 * math.pi * np.arange(_RAYS) / _RAYS
    rays = np.stack([np.cos(angles), np.sin(angles)])
    count = len(discs)
    last = Outlines(discs, np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count))
    if count == 0:
        return last
    for reach in _REACHES:
        distances, steps = _edges(picture, discs, rays, voting, reach)
        last = _fitted(discs, distances, steps, rays, voting)
        discs = last.discs
    return last


def _edges(
    picture: NDArray[np.uint8],
    discs: NDArray[np.float64],
    rays: NDArray[np.float64],
    voting: Voting,
    reach: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of the edge on each ray from the centre, and its step, (n, rays); NaN: none."""
    width = np.maximum(reach * discs[:, 2:], _LEAST_REACH_PX)
    usual = float(np.median(width))
    samples = min(_MAX_SAMPLES, math.ceil(2.0 * usual / _SAMPLE_PX) + 3)
    parts = np.linspace(-1.0, 1.0, samples)
    pitch = parts[1] - parts[0]
    along = np.maximum(discs[:, 2:] + width * parts, 0.0).astype(np.float32)
    across, down = rays.astype(np.float32)[:, :, None]
    x = discs[:, 0, None, None].astype(np.float32) + across * along[:, None, :]
    y = discs[:, 1, None, None].astype(np.float32) + down * along[:, None, :]
    shape = len(discs) * _RAYS, samples
    # OpenCV takes at most 32767 rows and columns.
    flat = len(discs), _RAYS * samples
    profile = cv2.remap(
        picture.astype(np.float32),
        x.reshape(flat),
        y.reshape(flat),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(shape)
    # Step over a length of about two pixels.
    half = max(1, round(1.0 / (pitch * usual)))
    rise = profile[:, : -2 * half] - profile[:, 2 * half :]
    rise = np.abs(rise) if voting.sign == 0 else voting.sign * rise
    inner = parts[half:-half]
    # Of the steepest places, among equal ones that nearest to where the outline was before.
    peaks = np.zeros_like(rise)
    peaks[:, 1:-1] = (rise[:, 1:-1] >= rise[:, :-2]) & (rise[:, 1:-1] > rise[:, 2:])
    rated = rise * peaks * (1.0 - 0.5 * np.abs(inner))
    best = np.clip(np.argmax(rated, axis=1), 1, rated.shape[1] - 2)
    row = np.arange(shape[0])
    before, at, after = (rise[row, best + k] for k in (-1, 0, 1))
    bend = before - 2.0 * at + after
    shift = np.where(bend < 0.0, 0.5 * (before - after) / np.where(bend < 0.0, bend, 1.0), 0.0)
    distance = inner[best] + pitch * np.clip(shift, -0.5, 0.5)
    ends = [0, -1]
    inside = (x[..., ends] >= 0.0) & (x[..., ends] < picture.shape[1])
    inside &= (y[..., ends] >= 0.0) & (y[..., ends] < picture.shape[0])
    least = max(_LEAST_STEP * voting.step, _LEAST_NOISES * voting.noise)
    usable = (at > least) & (at >= before) & (at >= after)
    usable &= inside.all(axis=2).ravel()
    distances = width * np.where(usable, distance, math.nan).reshape(len(discs), _RAYS)
    return distances + discs[:, 2:], at.reshape(len(discs), _RAYS)


def _fitted(
    discs: NDArray[np.float64],
    distances: NDArray[np.float64],
    steps: NDArray[np.float64],
    rays: NDArray[np.float64],
    voting: Voting,
) -> Outlines:
    """Circles through the edges, without those that lie off, as linear least squares."""
    design = np.stack([rays[0], rays[1], np.ones(_RAYS)], axis=1)
    seen = np.isfinite(distances)
    values = np.where(seen, distances, 0.0)
    weights = seen.astype(np.float64)
    products = np.einsum('ri,rj->rij', design, design).reshape(_RAYS, 9)
    ridge = 1e-9 * np.eye(3)
    for _ in range(4):
        normal = (weights @ products).reshape(-1, 3, 3) + ridge
        right = (weights * values) @ design
        solution = np.linalg.solve(normal, right[..., None])[..., 0]
        off = values - solution @ design.T
        limit = np.maximum(_OFF_SHARE * np.abs(solution[:, 2:]), _OFF_PX)
        weights = seen * np.maximum(0.0, 1.0 - (off / (2.0 * limit)) ** 2) ** 2
    on = seen & (np.abs(off) < limit)
    edges = on.sum(axis=1)
    scatter = np.sqrt((on * off**2).sum(axis=1) / np.maximum(edges - 3, 1))
    variance = np.maximum(scatter, _LEAST_SCATTER_PX) ** 2 * _CORRELATION_FACTOR
    covariance = np.linalg.inv((on @ products).reshape(-1, 3, 3) + 1e-6 * np.eye(3))
    new = discs.copy()
    move = np.clip(solution[:, :2], -0.5 * discs[:, 2:], 0.5 * discs[:, 2:])
    enough = edges >= _LEAST_EDGES
    new[enough, :2] += move[enough]
    new[enough, 2] = np.clip(solution[enough, 2], 0.8 * voting.smallest, 1.25 * voting.largest)
    return Outlines(
        new,
        np.sqrt(variance * 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])),
        np.sqrt(variance * covariance[:, 2, 2]),
        np.where(enough, edges / _RAYS, 0.0),
        (on * steps).sum(axis=1) / np.maximum(edges, 1),
    )
