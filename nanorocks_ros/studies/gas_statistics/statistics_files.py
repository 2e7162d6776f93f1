"""Statistics of gases as tables and as values for JSON.

Tested by ``test/studies/gas_statistics/test_tray_statistics.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import write_package
from nanorocks_ros.records import Measured
from nanorocks_ros.studies.gas_statistics.velocity_distribution import EDGES, sonine_density
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from nanorocks_ros.studies.gas_statistics.tray_statistics import TrayStatistics

_TRAY = Column(name='tray', kind='int64', unit='1', doc='number of the tray')
_SPECIES = Column(name='species', kind='string', doc='material of the beads')
_CYCLE = Column(name='cycle', kind='int64', unit='1', doc='shaking events so far')
_RANDOM = Column(name='random', unit='1', doc='the same of beads placed at random')
TABLES = {
    'energies.csv': (
        _TRAY,
        _SPECIES,
        _CYCLE,
        Column(name='time', unit='s', doc='mean time since the shaking event'),
        Column(name='duration', unit='s', doc='length of the part of the cycle'),
        Column(name='mean_projected_speed', unit='m/s', doc='in the image plane'),
        Column(name='temperature_x', unit='m^2/s^2', doc='mean square of a component, columns'),
        Column(name='temperature_y', unit='m^2/s^2', doc='along rows'),
        Column(name='temperature_error', unit='m^2/s^2', doc='one standard error of each'),
        Column(name='energy', unit='J', doc='mean kinetic energy of a bead'),
        Column(name='energy_error', unit='J', doc='one standard error'),
        Column(name='share', unit='1', doc='of the beads, those that are seen'),
    ),
    'velocities.csv': (
        _TRAY,
        _SPECIES,
        Column(name='scaled_velocity', unit='1', doc='a component over its root mean square'),
        Column(name='density', unit='1', doc='probability density'),
        Column(name='density_error', unit='1', doc='one standard error'),
        Column(name='maxwell', unit='1', doc='density of Maxwell'),
        Column(name='sonine', unit='1', doc='density with the measured fourth cumulant'),
    ),
    'pairs.csv': (
        _TRAY,
        _SPECIES,
        Column(name='other', kind='string', doc='material of the other beads'),
        Column(name='distance', unit='m', doc='of two centres, in the image plane'),
        Column(name='pair_correlation', unit='1', doc='density of pairs over that at random'),
        Column(name='pair_correlation_error', unit='1', doc='one standard error'),
        _RANDOM,
    ),
    'structure.csv': (
        _TRAY,
        Column(name='wave_number', unit='1/m', doc='of the waves'),
        Column(name='structure_factor', unit='1', doc='1 for beads placed independently'),
        Column(name='structure_factor_error', unit='1', doc='one standard error'),
        _RANDOM,
    ),
    'clustering.csv': (
        _TRAY,
        _CYCLE,
        Column(name='time', unit='s', doc='since the shaking event'),
        Column(name='structure_factor', unit='1', doc='of the longest waves'),
        _RANDOM,
        Column(name='random_deviation', unit='1', doc='standard deviation at random'),
    ),
}
"""Columns of the tables by name of file."""


def write_tables(folder: Path, statistics: Mapping[int, TrayStatistics]) -> None:
    """Write all tables into a folder.

    Parameters
    ----------
    folder : Path
        Exists; tables there are replaced.
    statistics : mapping of int to TrayStatistics
        By tray.

    Raises
    ------
    RecordingError
        When a file cannot be written.
    """
    rows = {
        'energies.csv': _energies,
        'velocities.csv': _velocities,
        'pairs.csv': _pairs,
        'structure.csv': _structure,
        'clustering.csv': _clustering,
    }
    for name, columns in TABLES.items():
        lines = (row for tray in statistics.values() for row in rows[name](tray))
        write_csv(folder / name, columns, lines)
    write_package(folder, TABLES, run_provenance())


def statistics_values(statistics: TrayStatistics) -> dict[str, Any]:
    """The numbers of a tray for JSON, in SI units; None for what is not known."""
    values = {
        'cycles': list(statistics.cycles),
        'seconds': statistics.seconds,
        'species': [_species_values(statistics, kind) for kind in _kinds(statistics)],
        'clustering_onset': [
            {'cycle': cycle.cycle, 'onset': cycle.onset} for cycle in statistics.clustering
        ],
    }
    plain: dict[str, Any] = json_values(values)
    return plain


def _kinds(statistics: TrayStatistics) -> range:
    return range(len(statistics.tray.species))


def _measured(name: str, measured: Measured) -> dict[str, float]:
    """A value and its error under their names."""
    return {name: measured.value, f'{name}_error': measured.error}


def _species_values(statistics: TrayStatistics, kind: int) -> dict[str, Any]:
    shape, rate = statistics.velocities[kind], statistics.collisions[kind]
    walls = statistics.wall_hits[kind]
    values: dict[str, Any] = {
        'material': statistics.tray.species[kind].material,
        **_measured('energy_ratio', statistics.energy_ratios[kind]),
    }
    unknown = Measured()
    for name, measured in (
        ('fourth_cumulant', shape.fourth_cumulant if shape else unknown),
        ('anisotropy', shape.anisotropy if shape else unknown),
        ('velocity_correlation', shape.correlation if shape else unknown),
        ('velocity_relaxation', rate.relaxation if rate else unknown),
        ('collisions_per_path', rate.per_path if rate else unknown),
        ('mean_free_path', rate.mean_free_path if rate else unknown),
        ('wall_hits_per_path', walls.per_path if walls else unknown),
    ):
        values.update(_measured(name, measured))
    values['theory_collisions_per_path'] = rate.theory_per_path if rate else None
    values['theory_mean_free_path'] = rate.theory_mean_free_path if rate else None
    values['theory_wall_hits_per_path'] = walls.theory_per_path if walls else None
    return values


def _energies(statistics: TrayStatistics) -> Iterator[tuple[object, ...]]:
    for kind, part in zip(statistics.tray.species, statistics.temperatures, strict=True):
        for place in range(part.time.size):
            yield (
                statistics.tray.number,
                kind.material,
                int(part.cycle[place]),
                float(part.time[place]),
                float(part.duration[place]),
                float(part.mean_projected_speed[place]),
                float(part.temperature[place, 0]),
                float(part.temperature[place, 1]),
                float(part.temperature_error[place]),
                float(part.energy[place]),
                float(part.energy_error[place]),
                float(part.share[place]),
            )


def _velocities(statistics: TrayStatistics) -> Iterator[tuple[object, ...]]:
    middles = 0.5 * (EDGES[:-1] + EDGES[1:])
    maxwell = sonine_density(middles, 0.0)
    for kind, shape in zip(statistics.tray.species, statistics.velocities, strict=True):
        if shape is None:
            continue
        sonine = sonine_density(middles, shape.fourth_cumulant.value)
        columns = (middles, shape.density, shape.density_error, maxwell, sonine)
        for row in zip(*(column.tolist() for column in columns), strict=True):
            yield statistics.tray.number, kind.material, *row


def _pairs(statistics: TrayStatistics) -> Iterator[tuple[object, ...]]:
    for pair in statistics.pairs:
        names = (statistics.tray.species[kind].material for kind in pair.species)
        columns: Sequence[Any] = pair.distance, pair.value, pair.error, pair.random
        first, second = names
        for row in zip(*(column.tolist() for column in columns), strict=True):
            yield statistics.tray.number, first, second, *row


def _structure(statistics: TrayStatistics) -> Iterator[tuple[object, ...]]:
    factor = statistics.structure
    columns = factor.wave_number, factor.value, factor.error, factor.random
    for row in zip(*(column.tolist() for column in columns), strict=True):
        yield statistics.tray.number, *row


def _clustering(statistics: TrayStatistics) -> Iterator[tuple[object, ...]]:
    for cycle in statistics.clustering:
        for time, value in zip(cycle.time.tolist(), cycle.value.tolist(), strict=True):
            yield (
                statistics.tray.number,
                cycle.cycle,
                time,
                value,
                cycle.random,
                cycle.random_deviation,
            )
