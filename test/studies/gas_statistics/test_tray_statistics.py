"""All statistics of a tray, their tables and their figure."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import cv2
import pytest
from gas_tracks import tracked_gas, with_beads_lost

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.outputs.tables.csv_tables import read_csv
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.studies.gas_statistics.statistics_figure import statistics_figure
from nanorocks_ros.studies.gas_statistics.statistics_files import (
    TABLES,
    statistics_values,
    write_tables,
)
from nanorocks_ros.studies.gas_statistics.tray_statistics import GasChoices, tray_statistics


@pytest.fixture(scope='module')
def statistics():
    gas = tracked_gas(3, 0)
    return tray_statistics(gas.tracks, gas.tray)


def test_two_cycles_count_as_one_gas(statistics):
    gas, other = tracked_gas(3, 0), tracked_gas(3, 1)
    later = [
        replace(record, cycle=2, stamp_ns=record.stamp_ns + 60_000_000_000)
        for record in other.tracks
    ]
    both = tray_statistics([*gas.tracks, *later], gas.tray)
    assert both.cycles == (1, 2)
    assert both.seconds == pytest.approx(2.0 * statistics.seconds)
    assert [cycle.cycle for cycle in both.clustering] == [1, 2]
    of_first, of_both = statistics.velocities[1], both.velocities[1]
    assert of_both.density_error.mean() < of_first.density_error.mean()
    first = both.temperatures[0].cycle == 1
    assert both.temperatures[0].energy[first] == pytest.approx(statistics.temperatures[0].energy)


def test_a_mixture_is_near_equipartition_and_its_first_species_is_the_unit(statistics):
    unit, ratio = statistics.energy_ratios
    assert (unit.value, unit.error) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-12))
    assert abs(ratio.value - 1.0) < max(4.0 * ratio.error, 0.3)


def test_lost_beads_leave_pairs_and_structure(statistics):
    gas = tracked_gas(3, 0)
    lost = tray_statistics(with_beads_lost(gas.tracks, 0.15), gas.tray)
    long = slice(0, 4)
    assert lost.structure.value[long].mean() == pytest.approx(
        statistics.structure.value[long].mean(), abs=0.06
    )
    for few, all_pairs in zip(lost.pairs, statistics.pairs, strict=True):
        assert few.value.mean() == pytest.approx(all_pairs.value.mean(), abs=0.03)


def test_tables_hold_the_numbers(statistics, tmp_path):
    write_tables(tmp_path, {3: statistics})
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*TABLES, PACKAGE])
    names, rows = read_csv(tmp_path / 'energies.csv')
    column = names.index('energy')
    part = statistics.temperatures[0]
    written = [float(row[column]) for row in rows if row[1] == 'acrylic']
    assert written == part.energy.tolist()
    names, rows = read_csv(tmp_path / 'pairs.csv')
    assert {(row[1], row[2]) for row in rows} == {
        ('acrylic', 'acrylic'),
        ('acrylic', 'glass'),
        ('glass', 'glass'),
    }
    assert len(read_csv(tmp_path / 'clustering.csv')[1]) == statistics.clustering[0].time.size


def test_json_has_none_for_what_is_not_known(statistics):
    values = json.loads(json.dumps(statistics_values(statistics), allow_nan=False))
    assert [kind['material'] for kind in values['species']] == ['acrylic', 'glass']
    assert values['clustering_onset'] == [{'cycle': 1, 'onset': None}]
    unknown = replace(statistics, collisions=(None, None), velocities=(None, None))
    species = statistics_values(unknown)['species'][0]
    assert species['mean_free_path'] is species['fourth_cumulant'] is None


def test_the_figure_shows_both_species_and_an_onset(statistics, tmp_path):
    statistics_figure(tmp_path / 'without.png', statistics)
    onset = (replace(statistics.clustering[0], onset=12.0),)
    statistics_figure(tmp_path / 'with.png', replace(statistics, clustering=onset))
    plain, marked = (cv2.imread(str(tmp_path / name)) for name in ('without.png', 'with.png'))
    assert plain.shape == marked.shape
    half = plain.shape[0] // 2, 2 * plain.shape[1] // 3
    changed = (plain != marked).any(axis=2)
    assert changed[half[0] :, half[1] :].any()
    assert not changed[: half[0] - 40].any()


def test_gases_at_rest_and_wrong_choices_are_refused():
    gas = tracked_gas(3, 0)
    with pytest.raises(FitError, match='no bead moves'):
        tray_statistics(gas.tracks, gas.tray, GasChoices(start=100.0))
    with pytest.raises(ConfigurationError, match='give an end after the start'):
        GasChoices(start=5.0, end=4.0)
    with pytest.raises(ConfigurationError, match='wall_restitution'):
        GasChoices(wall_restitution=1.2)


def test_a_crowded_tray_has_no_collision_rates_but_all_else():
    gas = tracked_gas(1, 0)
    flat = replace(gas.tray, dimensions=(*gas.tray.dimensions[:2], 0.0021))
    crowded = replace(flat, species=(replace(flat.species[0], count=33),))
    limited = tray_statistics(gas.tracks, crowded)
    assert limited.collisions == (None,)
    assert 'no collision rates' in limited.notices[0]
    assert math.isfinite(limited.velocities[0].fourth_cumulant.value)
