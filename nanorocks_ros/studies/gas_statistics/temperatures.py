"""Granular temperature and energy of each species over time.

Tested by ``test/studies/gas_statistics/test_velocity_samples.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import Measured
from nanorocks_ros.studies.gas_statistics.jackknife import block_sums, jackknife
from nanorocks_ros.studies.gas_statistics.velocity_samples import SPEED, XX, YY

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.gas_statistics.velocity_samples import VelocitySamples

# Relative errors of what is subtracted for noise, and of what is added for deflections.
_NOISE_ERROR, _DEFLECTION_ERROR = 0.2, 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeciesTemperatures:
    """Of one species, in n parts of the cycles, each of equal paths.

    Parameters
    ----------
    cycle : ndarray of int, (n,)
    time, duration : ndarray (n,), [s]
        Mean time since the shaking event, and length of the part.
    mean_projected_speed : ndarray (n,), [m/s]
    temperature : ndarray (n, 2), [m^2/s^2]
        Mean squares of both seen components; noise is subtracted.
    temperature_error : ndarray (n,), [m^2/s^2]
        Of their mean: of the measurement, and for beads that are not seen, not of the chance that
        made these velocities.
    energy, energy_error : ndarray (n,), [J]
        Of one bead in both seen components.
    share : ndarray (n,)
        Beads seen over those in the tray.
    """

    cycle: NDArray[np.int64]
    time: NDArray[np.float64]
    duration: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    temperature: NDArray[np.float64]
    temperature_error: NDArray[np.float64]
    energy: NDArray[np.float64]
    energy_error: NDArray[np.float64]
    share: NDArray[np.float64]


def species_temperatures(
    samples: VelocitySamples, tray: Tray, species: int
) -> SpeciesTemperatures:
    """Temperature and energy of a species over time.

    A range of diameters counts with the mass of its middle.

    Parameters
    ----------
    samples : VelocitySamples
    tray : Tray
    species : int
    """
    kind = tray.species[species]
    known = np.isfinite(samples.moments[:, species, XX])
    rows = []
    for block in np.unique(samples.block[known]):
        part = np.flatnonzero(known & (samples.block == block))
        beads = samples.beads[part, species]
        moments = beads @ samples.moments[part, species] / beads.sum()
        square = moments[XX] + moments[YY]
        noise = float(beads @ samples.noise[part, species] / beads.sum())
        raw = float(beads @ samples.uncorrected[part, species] / beads.sum())
        share = float(beads.mean()) / kind.count
        unseen = math.sqrt(max(1.0 - share, 0.0) / float(beads.mean())) * square
        error = math.hypot(
            _NOISE_ERROR * noise, _DEFLECTION_ERROR * (square - raw + noise), unseen
        )
        rows.append(
            (
                samples.cycle[part[0]],
                samples.time[part].mean(),
                np.ptp(samples.time[part]),
                moments[SPEED],
                moments[XX],
                moments[YY],
                0.5 * error,
                0.5 * kind.bead_mass * square,
                0.5 * kind.bead_mass * error,
                share,
            )
        )
    table = np.array(rows, dtype=np.float64).reshape(-1, 10)
    return SpeciesTemperatures(
        cycle=table[:, 0].astype(np.int64),
        time=table[:, 1],
        duration=table[:, 2],
        mean_projected_speed=table[:, 3],
        temperature=table[:, 4:6],
        temperature_error=table[:, 6],
        energy=table[:, 7],
        energy_error=table[:, 8],
        share=table[:, 9],
    )


def energy_ratios(samples: VelocitySamples, tray: Tray) -> Sequence[Measured]:
    """Energy of a bead of each species over that of a bead of the first; 1 for equipartition.

    The error is from the scatter of the blocks.

    Parameters
    ----------
    samples : VelocitySamples
    tray : Tray
    """
    masses = np.array([kind.bead_mass for kind in tray.species])
    squares = samples.moments[..., XX] + samples.moments[..., YY]
    used = np.isfinite(squares).all(axis=1)
    if not used.any():
        return [Measured() for _ in masses]
    # Late times, at which beads are slow, count as much as early ones.
    energies = masses * squares[used]
    means = block_sums(energies, samples.block[used], int(samples.block.max()) + 1)
    totals = means.sum(axis=1, keepdims=True)
    sums = np.divide(means, totals, out=np.zeros_like(means), where=totals > 0.0)
    value, error = jackknife(sums, lambda total: total / total[0])
    return [
        Measured(float(ratio), float(spread)) for ratio, spread in zip(value, error, strict=True)
    ]
