"""Shape of the velocity distribution: fourth cumulant, anisotropy, histogram."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Measured
from nanorocks_ros.studies.gas_statistics.jackknife import block_sums, jackknife
from nanorocks_ros.studies.gas_statistics.velocity_samples import FOURTH, PAIR, XX, XY, YY

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from nanorocks_ros.studies.gas_statistics.velocity_samples import VelocitySamples

EDGES = np.linspace(-5.0, 5.0, 41)
"""Edges of the bins of the histogram, in thermal speeds."""
# Frames that are weighted alike: speeds hardly change in a second.
_RUNNING = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class VelocityDistribution:
    """Of one species, scaled with its granular temperature at each time.

    Parameters
    ----------
    fourth_cumulant : Measured
        a2 of the expansion in Sonine polynomials, <v^4> / (2 <v^2>^2) - 1 of the projected
        velocities: 0 of Maxwell's distribution, and the same as in space if it is isotropic.
    anisotropy : Measured
        (T_x - T_y) / (T_x + T_y).
    correlation : Measured
        2 <v_x v_y> / (T_x + T_y).
    density, density_error : ndarray (n_bins,)
        Of a component in units of its root mean square, in the bins of `EDGES`.
    """

    fourth_cumulant: Measured
    anisotropy: Measured
    correlation: Measured
    density: NDArray[np.float64]
    density_error: NDArray[np.float64]


def velocity_distribution(samples: VelocitySamples, species: int) -> VelocityDistribution | None:
    """The velocity distribution of a species; None where it was not seen.

    Every time counts by the beads that are seen then. Fourth moments are compared with products
    of the squares of *different* beads: so neither the cooling nor the energy that few beads
    share enters the cumulant.

    Parameters
    ----------
    samples : VelocitySamples
    species : int
    """
    moments = samples.moments[:, species]
    square = moments[:, XX] + moments[:, YY]
    used = np.isfinite(square)
    if not used.any():
        return None
    n_blocks = int(samples.block.max()) + 1
    scale = np.ones_like(square)
    scale[used] = _smooth(square[used], samples.block[used])
    weights = samples.beads[:, species] * used / scale
    fourth = np.nan_to_num(moments[:, [FOURTH, PAIR]]) * (weights / scale)[:, np.newaxis]
    seconds = np.nan_to_num(moments[:, [XX, YY, XY]]) * weights[:, np.newaxis]
    sums = block_sums(seconds, samples.block, n_blocks)
    return VelocityDistribution(
        fourth_cumulant=_measured(
            block_sums(fourth, samples.block, n_blocks), lambda s: s[0] / (2.0 * s[1]) - 1.0
        ),
        anisotropy=_measured(sums, lambda s: (s[0] - s[1]) / (s[0] + s[1])),
        correlation=_measured(sums, lambda s: 2.0 * s[2] / (s[0] + s[1])),
        **_histogram(samples, species, np.flatnonzero(used), n_blocks),
    )


def sonine_density(component: NDArray[np.float64], fourth_cumulant: float) -> NDArray[np.float64]:
    """Density of a component in units of its root mean square, to the first Sonine polynomial.

    Parameters
    ----------
    component : ndarray
    fourth_cumulant : float

    References
    ----------
    van Noije and Ernst 1998, Granul. Matter 1, 57, integrated over the other components.
    """
    squares = component * component
    maxwell = np.exp(-0.5 * squares) / math.sqrt(2.0 * math.pi)
    density: NDArray[np.float64] = maxwell * (
        1.0 + fourth_cumulant * (squares * squares - 6.0 * squares + 3.0) / 8.0
    )
    return density


def _measured(
    sums: NDArray[np.float64], function: Callable[[NDArray[np.float64]], float]
) -> Measured:
    value, error = jackknife(sums, function)
    return Measured(float(value), float(error))


def _smooth(square: NDArray[np.float64], block: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean over about a second, within a block: the scale of the weights."""
    smooth = np.empty_like(square)
    for number in np.unique(block):
        own = np.flatnonzero(block == number)
        for first in range(0, own.size, _RUNNING):
            part = own[first : first + _RUNNING]
            smooth[part] = max(float(square[part].mean()), np.finfo(float).tiny)
    return smooth


def _histogram(
    samples: VelocitySamples, species: int, frames: NDArray[np.int64], n_blocks: int
) -> dict[str, NDArray[np.float64]]:
    thermal = _thermal_speeds(samples, species)
    counts = np.zeros((n_blocks, EDGES.size - 1))
    for frame in frames.tolist():
        own = samples.velocities[frame][samples.species[frame] == species]
        counts[samples.block[frame]] += np.histogram(own / thermal[frame], EDGES)[0]
    width = float(EDGES[1] - EDGES[0])
    density, error = jackknife(counts, lambda total: total / (total.sum() * width))
    return {'density': density, 'density_error': error}


def _thermal_speeds(samples: VelocitySamples, species: int) -> NDArray[np.float64]:
    """Root mean square of a measured component at each frame, (m,), [m/s].

    Interpolated between blocks, in which so many collisions happen that single beads do not set
    the scale of their own velocities.
    """
    squares = samples.uncorrected[:, species]
    thermal = np.full(squares.size, math.nan)
    for cycle in np.unique(samples.cycle):
        own = samples.cycle == cycle
        known = own & np.isfinite(squares)
        blocks = np.unique(samples.block[known])
        if blocks.size == 0:
            continue
        rows = [np.flatnonzero(known & (samples.block == block)) for block in blocks]
        paths = [samples.path[row].mean() for row in rows]
        # The logarithm falls evenly with the path.
        logs = [math.log(0.5 * float(squares[row].mean())) for row in rows]
        slope = np.gradient(logs, paths) if len(paths) > 1 else np.zeros(1)
        inside = np.interp(samples.path[own], paths, logs)
        before = np.minimum(samples.path[own] - paths[0], 0.0) * slope[0]
        after = np.maximum(samples.path[own] - paths[-1], 0.0) * slope[-1]
        thermal[own] = np.exp(0.5 * (inside + before + after))
    return thermal
