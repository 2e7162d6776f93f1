"""Results of an analysis, as JSON and tables."""

from __future__ import annotations

import csv
import json

from nanorocks_ros.experiment.settings import PipelineSettings
from nanorocks_ros.records import CorEstimate, CorRelation, CorStatus, SpeedEstimate, SpeedMethod
from nanorocks_ros.study.export import as_json, write_results
from nanorocks_ros.study.offline import Analysis, TrayResults

NS = 1_000_000_000
SPEED = SpeedEstimate(
    stamp_ns=20 * NS,
    tray=5,
    cycle=1,
    cycle_start_ns=NS,
    mean_projected_speed=1e-3,
    mean_projected_speed_error=1e-5,
    window=0.1,
    method=SpeedMethod.TRACKING,
)
COR = CorEstimate(
    stamp_ns=20 * NS,
    tray=5,
    cycle=1,
    status=CorStatus.FINAL,
    relation=CorRelation.LIBRARY,
    first_species_initial_speed=9e-3,
    first_species_initial_speed_error=2e-4,
    first_species_haff_time=2.5,
    first_species_haff_time_error=0.125,
)


def analysis():
    return Analysis(epoch_ns=0, trays={5: TrayResults(speeds=[SPEED], cors=[COR])})


def test_the_decay_of_each_species_is_among_the_numbers_of_a_cycle():
    (cycle,) = json.loads(json.dumps(as_json(analysis()), allow_nan=False))['trays']['5']['cycles']
    assert cycle['first_species_initial_speed'] == 9e-3
    assert cycle['first_species_initial_speed_error'] == 2e-4
    assert cycle['first_species_haff_time'] == 2.5
    assert cycle['first_species_haff_time_error'] == 0.125
    # What is not known is null.
    assert cycle['second_species_initial_speed'] is None
    assert cycle['second_species_haff_time_error'] is None


def test_the_decay_of_each_species_is_in_the_table(tmp_path):
    write_results(analysis(), tmp_path / 'results', tmp_path / 'bag', PipelineSettings())
    with (tmp_path / 'results' / 'tray_5_cor.csv').open(newline='') as stream:
        (row,) = csv.DictReader(stream)
    assert float(row['first_species_haff_time [s]']) == 2.5
    assert row['second_species_haff_time [s]'] == 'nan'
