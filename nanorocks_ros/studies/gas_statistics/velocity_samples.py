"""Moments of the velocities of beads, from displacements, without noise and deflections.

Velocities are displacements over a few frames, so many that noise adds at most 2 % to their
squares; that part is subtracted. A bead that collides within the window moves less far. At first
the moments fall in proportion to the length of the window: so what they are in a window of no
length is twice those of half a window less those of the whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.studies.gas_statistics.displacement_windows import CycleTracks, Window

XX, YY, XY, SPEED, FOURTH, PAIR = range(6)
"""Columns of moments: mean v_x^2, v_y^2, v_x v_y, |v|, |v|^4 over the beads, and |v_i|^2 |v_j|^2
over pairs of different beads."""
MOMENTS = 6
N_BLOCKS = 10
"""Blocks of a cycle, of equal paths: of about as many collisions."""

_LAGS = (1, 2, 3, 4, 6, 8, 12, 16)
# Smallest ratio of mean square displacement to its part that is noise.
_LEAST_RATIO = 50.0
# Variances of a coordinate in the mean square displacement in the plane.
_VARIANCES = 4.0
_LEAST_BEADS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocitySamples:
    """Velocities of the beads of a tray in m frames of its cycles.

    Parameters
    ----------
    cycle : ndarray of int, (m,)
    time : ndarray (m,), [s]
        Since the shaking event of the cycle.
    path : ndarray (m,), [m]
        Of a bead on the average since the first frame of the cycle.
    block : ndarray of int, (m,)
        Number of the part of a cycle, of equal paths; rises over all cycles.
    beads : ndarray (m, n_species)
        How many were seen.
    moments : ndarray (m, n_species, MOMENTS), [m^2/s^2], [m/s], [m^4/s^4]
        Corrected; NaN of a species of which fewer than two beads were seen.
    uncorrected : ndarray (m, n_species)
        Mean square speed of half a window, [m^2/s^2].
    noise : ndarray (m, n_species), [m^2/s^2]
        What noise added to that.
    velocities : sequence of m ndarrays (n, 2), [m/s]
        Of single beads, with what noise and deflections do to them.
    species : sequence of m ndarrays of int, (n,)
    """

    cycle: NDArray[np.int64]
    time: NDArray[np.float64]
    path: NDArray[np.float64]
    block: NDArray[np.int64]
    beads: NDArray[np.float64]
    moments: NDArray[np.float64]
    uncorrected: NDArray[np.float64]
    noise: NDArray[np.float64]
    velocities: Sequence[NDArray[np.float64]]
    species: Sequence[NDArray[np.int32]]


def raw_moments(velocities: NDArray[np.float64], variance: float) -> NDArray[np.float64]:
    """Moments of velocities (n, 2) of a species, less those of their noise, (MOMENTS,).

    Parameters
    ----------
    velocities : ndarray (n, 2), [m/s]
        Of at least two beads.
    variance : float, [m^2/s^2]
        Of the noise of a component, Gaussian and independent.
    """
    n = velocities.shape[0]
    x, y = velocities.T
    squares = x * x + y * y
    mean, fourth = float(squares.mean()), float((squares * squares).mean())
    pairs = (n * mean * mean - fourth) / (n - 1)
    # |v| of a normal law grows as the root of its variance does.
    shrink = np.sqrt(max(1.0 - 2.0 * variance / mean, 0.0)) if mean > 0.0 else 1.0
    return np.array(
        (
            (x * x).mean() - variance,
            (y * y).mean() - variance,
            (x * y).mean(),
            np.sqrt(squares).mean() * shrink,
            fourth - 8.0 * variance * mean + 8.0 * variance**2,
            pairs - 4.0 * variance * mean + 4.0 * variance**2,
        )
    )


def sample_velocities(cycles: Sequence[CycleTracks], n_species: int) -> VelocitySamples:
    """Velocities of the beads in every frame in which they can be measured.

    Parameters
    ----------
    cycles : sequence of CycleTracks
    n_species : int
    """
    parts = [part for cycle in cycles for part in _cycle_samples(cycle, n_species)]
    frames = [sample for part in parts for sample in part]
    cycle = np.array([sample.cycle for sample in frames], dtype=np.int64)
    time = np.array([sample.time for sample in frames])
    shape = len(frames), n_species
    beads = np.array([sample.beads for sample in frames]).reshape(shape)
    moments = np.array([sample.moments for sample in frames]).reshape(*shape, MOMENTS)
    path, block = _paths(cycle, time, beads, moments[..., SPEED])
    return VelocitySamples(
        cycle=cycle,
        time=time,
        path=path,
        block=block,
        beads=beads,
        moments=moments,
        uncorrected=np.array([sample.uncorrected for sample in frames]).reshape(shape),
        noise=np.array([sample.noise for sample in frames]).reshape(shape),
        velocities=[sample.velocities for sample in frames],
        species=[sample.species for sample in frames],
    )


@dataclass(slots=True, kw_only=True)
class _Sample:
    cycle: int
    time: float
    beads: NDArray[np.float64]
    moments: NDArray[np.float64]
    uncorrected: NDArray[np.float64]
    noise: NDArray[np.float64]
    velocities: NDArray[np.float64]
    species: NDArray[np.int32]


def _cycle_samples(cycle: CycleTracks, n_species: int) -> list[list[_Sample]]:
    samples = []
    for chunk in cycle.chunks():
        noise = cycle.noise(chunk, n_species)
        lag = least_lag(cycle, chunk, noise)
        if lag is None:
            continue
        windows = ((frame, cycle.window(frame, lag)) for frame in range(chunk.start, chunk.stop))
        samples.append(
            [
                _sample(cycle, frame, window, noise)
                for frame, window in windows
                if window is not None and window.species.size >= _LEAST_BEADS
            ]
        )
    return samples


def least_lag(cycle: CycleTracks, chunk: slice, noise: NDArray[np.float64]) -> int | None:
    """Number of frames in which every species moves well beyond its noise; None if it is long.

    Parameters
    ----------
    cycle : CycleTracks
    chunk : slice
        Frames of it.
    noise : ndarray (n_species,), [m^2]
        Variance of a coordinate.
    """
    known = np.flatnonzero(np.isfinite(noise))
    if known.size == 0:
        return None
    for lag in _LAGS:
        windows = [cycle.window(frame, lag) for frame in range(chunk.start, chunk.stop, lag)]
        used = [window for window in windows if window is not None]
        if not used:
            return None
        squares = np.concatenate([(window.steps[0] ** 2).sum(axis=1) for window in used])
        species = np.concatenate([window.species for window in used])
        means = [squares[species == index].mean() for index in known if (species == index).any()]
        limits = [noise[index] for index in known if (species == index).any()]
        if all(
            mean >= _LEAST_RATIO * _VARIANCES * limit
            for mean, limit in zip(means, limits, strict=True)
        ):
            return lag
    return None


def _sample(cycle: CycleTracks, frame: int, window: Window, noise: NDArray[np.float64]) -> _Sample:
    n_species = noise.size
    moments = np.full((n_species, MOMENTS), np.nan)
    uncorrected, added = np.full(n_species, np.nan), np.zeros(n_species)
    counts = np.bincount(window.species, minlength=n_species).astype(np.float64)
    halves = window.steps / window.seconds
    whole = window.steps.sum(axis=0) / (2.0 * window.seconds)
    for index in np.flatnonzero((counts >= _LEAST_BEADS) & np.isfinite(noise)):
        own = window.species == index
        variance = 2.0 * float(noise[index]) / window.seconds**2
        first, second = (raw_moments(half[own], variance) for half in halves)
        short = 0.5 * (first + second)
        moments[index] = 2.0 * short - raw_moments(whole[own], 0.25 * variance)
        added[index] = 2.0 * variance
        uncorrected[index] = short[XX] + short[YY] + added[index]
    return _Sample(
        cycle=cycle.number,
        time=float(cycle.times[frame]) + window.seconds,
        beads=counts,
        moments=moments,
        uncorrected=uncorrected,
        noise=added,
        velocities=halves[0],
        species=window.species,
    )


def _paths(
    cycle: NDArray[np.int64],
    time: NDArray[np.float64],
    beads: NDArray[np.float64],
    speeds: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mean path of a bead since the start of its cycle, and the block of each frame."""
    path, block = np.zeros(time.size), np.zeros(time.size, dtype=np.int64)
    weights = np.where(np.isfinite(speeds), beads, 0.0)
    mean = (weights * np.nan_to_num(speeds)).sum(axis=1) / np.maximum(weights.sum(axis=1), 1.0)
    for place, number in enumerate(np.unique(cycle)):
        own = np.flatnonzero(cycle == number)
        steps = np.diff(time[own], prepend=time[own[0]])
        path[own] = np.cumsum(steps * mean[own])
        length = max(float(path[own[-1]]), np.finfo(float).tiny)
        part = np.minimum((N_BLOCKS * path[own] / length).astype(np.int64), N_BLOCKS - 1)
        block[own] = place * N_BLOCKS + part
    return path, block
