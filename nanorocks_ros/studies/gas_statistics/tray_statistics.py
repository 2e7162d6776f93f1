"""Statistics of the gas in a tray, from the tracks of its beads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.kinetic_theory import check_restitution
from nanorocks_ros.studies.gas_statistics.collision_rates import collision_rate, theory_rates
from nanorocks_ros.studies.gas_statistics.displacement_windows import split_cycles
from nanorocks_ros.studies.gas_statistics.pair_correlations import pair_correlations
from nanorocks_ros.studies.gas_statistics.random_arrangements import Places, random_arrangements
from nanorocks_ros.studies.gas_statistics.structure_factors import (
    Waves,
    clustering,
    structure_factor,
)
from nanorocks_ros.studies.gas_statistics.temperatures import (
    energy_ratios,
    species_temperatures,
)
from nanorocks_ros.studies.gas_statistics.velocity_distribution import velocity_distribution
from nanorocks_ros.studies.gas_statistics.velocity_samples import sample_velocities
from nanorocks_ros.studies.gas_statistics.wall_rates import wall_rate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Measured, Tracks
    from nanorocks_ros.studies.gas_statistics.collision_rates import CollisionRate
    from nanorocks_ros.studies.gas_statistics.displacement_windows import CycleTracks
    from nanorocks_ros.studies.gas_statistics.pair_correlations import PairCorrelation
    from nanorocks_ros.studies.gas_statistics.structure_factors import (
        Clustering,
        StructureFactor,
    )
    from nanorocks_ros.studies.gas_statistics.temperatures import SpeciesTemperatures
    from nanorocks_ros.studies.gas_statistics.velocity_distribution import VelocityDistribution
    from nanorocks_ros.studies.gas_statistics.velocity_samples import VelocitySamples
    from nanorocks_ros.studies.gas_statistics.wall_rates import WallRate

# Time between two frames whose places are used: they hardly change within less, [s].
_INTERVAL = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class GasChoices:
    """What is measured, and what theory is compared with.

    Parameters
    ----------
    start, end : float, [s]
        Part of each cycle, since its shaking event.
    restitution, wall_restitution : float, [0, 1]
        Of the gas that the collisions are compared with.

    Raises
    ------
    ConfigurationError
        For restitutions outside [0, 1], or an end before the start.
    """

    start: float = 1.75
    end: float = math.inf
    restitution: float = 0.9
    wall_restitution: float = 0.95

    def __post_init__(self) -> None:
        check_restitution(restitution=self.restitution, wall_restitution=self.wall_restitution)
        if not self.end > self.start >= 0.0:
            raise ConfigurationError(
                'statistics',
                f'from {self.start:g} to {self.end:g} s',
                'give an end after the start, and a start from 0 s on',
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayStatistics:
    """Statistics of the gas in one tray, over all its cycles.

    Parameters
    ----------
    tray : Tray
    cycles : tuple of int
        Numbers of those that are used.
    seconds : float
        Time that is used, of all cycles together.
    temperatures : tuple of SpeciesTemperatures
        Of each species.
    energy_ratios : tuple of Measured
        Energy of a bead of each species over that of one of the first.
    velocities : tuple of VelocityDistribution or None
        Of each species; None where it was not seen.
    collisions : tuple of CollisionRate or None
        Of each species; None where it cannot be told.
    wall_hits : tuple of WallRate or None
        Of each species, likewise.
    pairs : tuple of PairCorrelation
    structure : StructureFactor
    clustering : tuple of Clustering
        Of each cycle.
    notices : tuple of str
        What could not be measured, and why.
    """

    tray: Tray
    cycles: tuple[int, ...]
    seconds: float
    temperatures: tuple[SpeciesTemperatures, ...]
    energy_ratios: tuple[Measured, ...]
    velocities: tuple[VelocityDistribution | None, ...]
    collisions: tuple[CollisionRate | None, ...]
    wall_hits: tuple[WallRate | None, ...]
    pairs: tuple[PairCorrelation, ...]
    structure: StructureFactor
    clustering: tuple[Clustering, ...]
    notices: tuple[str, ...]


def tray_statistics(
    tracks: Sequence[Tracks], tray: Tray, choices: GasChoices | None = None
) -> TrayStatistics:
    """Measure the gas in a tray.

    Parameters
    ----------
    tracks : sequence of Tracks
        Of the tray, in order of time.
    tray : Tray
    choices : GasChoices, optional

    Raises
    ------
    FitError
        When no beads move measurably in the part of the cycles that is used.
    SimulationError
        When the beads of the tray do not fit into it.
    """
    choices = choices or GasChoices()
    kinds = range(len(tray.species))
    cycles = split_cycles(tracks, choices.start, choices.end)
    samples = sample_velocities(cycles, len(tray.species))
    moving = [cycle for cycle in cycles if (samples.cycle == cycle.number).any()]
    if not moving:
        raise FitError(
            f'tray {tray.number}',
            f'no bead moves measurably later than {choices.start:g} s after shaking',
            'give an earlier start, or look at the tracks with nanorocks track',
        )
    collisions, wall_hits, notices = _collisions(moving, samples, tray, choices)
    frames = [_frames(cycle, samples) for cycle in moving]
    places = [place for shown, _, _ in frames for place in shown]
    block = np.concatenate([blocks for _, _, blocks in frames])
    waves, random = Waves(tray), random_arrangements(tray)
    random_powers = waves.powers(random)
    powers = [waves.powers(shown) for shown, _, _ in frames]
    return TrayStatistics(
        tray=tray,
        cycles=tuple(cycle.number for cycle in moving),
        seconds=sum(float(cycle.times[-1] - cycle.times[0]) for cycle in moving),
        temperatures=tuple(species_temperatures(samples, tray, kind) for kind in kinds),
        energy_ratios=tuple(energy_ratios(samples, tray)),
        velocities=tuple(velocity_distribution(samples, kind) for kind in kinds),
        collisions=collisions,
        wall_hits=wall_hits,
        pairs=pair_correlations(places, block, tray, random),
        structure=structure_factor(waves, np.concatenate(powers), block, random_powers),
        clustering=tuple(
            clustering(waves, power, times, blocks, random_powers, cycle.number)
            for cycle, power, (_, times, blocks) in zip(moving, powers, frames, strict=True)
        ),
        notices=notices,
    )


def _collisions(
    cycles: Sequence[CycleTracks],
    samples: VelocitySamples,
    tray: Tray,
    choices: GasChoices,
) -> tuple[tuple[CollisionRate | None, ...], tuple[WallRate | None, ...], tuple[str, ...]]:
    """Rates of each species, with beads and with side walls, and why there are none."""
    try:
        theory = theory_rates(confined_gas(tray), choices.restitution, choices.wall_restitution)
    except (ConfigurationError, FitError) as error:
        notice = f'tray {tray.number}: no collision rates: {error}'
        none = tuple(None for _ in tray.species)
        return none, none, (notice,)
    rates = tuple(
        collision_rate(cycles, samples, tray, kind, rate) for kind, rate in enumerate(theory)
    )
    walls = tuple(
        wall_rate(cycles, samples, tray, kind, rate.wall_hits) for kind, rate in enumerate(theory)
    )
    return rates, walls, ()


def _frames(
    cycle: CycleTracks, samples: VelocitySamples
) -> tuple[list[Places], NDArray[np.float64], NDArray[np.int64]]:
    """Places of all beads in some frames, their times and the blocks that they belong to.

    Hidden beads count at their predicted places: they are hidden because others are near.
    """
    own = samples.cycle == cycle.number
    moments = np.arange(cycle.times[0], cycle.times[-1] + 0.5 * _INTERVAL, _INTERVAL)
    used = np.unique(np.clip(np.searchsorted(cycle.times, moments), 0, cycle.times.size - 1))
    frames = []
    for number in used.tolist():
        record = cycle.records[number]
        known = np.isfinite(record.positions).all(axis=1)
        frames.append(Places(record.positions[known], record.species[known]))
    times = cycle.times[used]
    nearest = np.clip(np.searchsorted(samples.time[own], times), 0, int(own.sum()) - 1)
    return frames, times, samples.block[own][nearest]
