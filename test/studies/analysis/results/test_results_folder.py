"""Results of an analysis, as JSON and tables."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path
from resource import RLIMIT_FSIZE, getrlimit, setrlimit

import numpy as np
import pytest

from benchmarks.file_steps import kill_at_each_step, run_until, was_killed
from nanorocks_ros.errors import RecordingError, UnwritableError
from nanorocks_ros.outputs.tables.csv_tables import number
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.records import (
    CorEstimate,
    CorRelation,
    CorStatus,
    Measured,
    Merge,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.results_folder import (
    FORMATS,
    check_results_folder,
    write_results,
)
from nanorocks_ros.studies.analysis.results.results_json import as_json, last_of_each_cycle
from nanorocks_ros.studies.results.record_columns import columns_of
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import from_array, layout
from nanorocks_ros.wire.products import MEASURED

NS = 1_000_000_000
SPEED = SpeedEstimate(
    stamp_ns=20 * NS,
    tray=5,
    cycle=1,
    cycle_start_ns=NS,
    mean_projected_speed=Measured(1e-3, 1e-5),
    window=0.1,
    method=SpeedMethod.TRACKING,
)
COR = CorEstimate(
    stamp_ns=20 * NS,
    tray=5,
    cycle=1,
    status=CorStatus.FINAL,
    relation=CorRelation.LIBRARY,
    species_initial_speeds=(Measured(9e-3, 2e-4),),
    species_haff_times=(Measured(2.5, 0.125),),
)


def analysis():
    return Analysis(epoch_ns=0, trays={5: TrayResults([SPEED, COR])})


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
    assert float(row['first_species_haff_time']) == 2.5
    assert row['second_species_haff_time'] == ''


def test_tables_in_parquet_hold_the_numbers_of_the_csv(tmp_path):
    pytest.importorskip('pyarrow')
    from pyarrow import parquet

    for form in FORMATS:
        folder = tmp_path / form
        write_results(analysis(), folder, tmp_path / 'bag', PipelineSettings(), form)
    assert {path.stem for path in (tmp_path / 'parquet').glob('*.parquet')} == {
        path.stem for path in (tmp_path / 'csv').glob('*.csv')
    }
    table = parquet.read_table(tmp_path / 'parquet' / 'tray_5_cor.parquet')
    with (tmp_path / 'csv' / 'tray_5_cor.csv').open(newline='') as stream:
        (row,) = csv.DictReader(stream)
    assert table.schema.names == list(row)
    for column in columns_of(CorEstimate):
        stored = table.schema.field(column.name).metadata[b'unit'].decode()
        value = table[column.name][0].as_py()
        assert stored == column.unit
        if column.kind == 'string':
            assert value == row[column.name]
        else:
            np.testing.assert_equal(value, number(row[column.name]))
    assert json.loads(table.schema.metadata[b'provenance'])['source'] == 'bag'


@pytest.mark.parametrize('earlier', [False, True])
def test_results_are_written_again_after_a_kill_at_any_step_and_nothing_is_left(tmp_path, earlier):
    before, folder = tmp_path / 'before', tmp_path / 'here'
    before.mkdir()
    folder.mkdir()
    if earlier:
        write_results(analysis(), before / 'out', tmp_path / 'bag', PipelineSettings())
        (before / 'out' / 'notes.txt').write_text('mine')
    kills, differences = kill_at_each_step(
        lambda: write_results(analysis(), folder / 'out', tmp_path / 'bag', PipelineSettings()),
        folder,
        before,
    )
    assert differences == []
    assert kills > 10
    assert os.listdir(folder) == ['out']
    assert (folder / 'out' / 'notes.txt').exists() == earlier


def test_earlier_results_are_back_before_the_work_begins_again(tmp_path):
    folder = tmp_path / 'here'
    folder.mkdir()

    def job():
        write_results(analysis(), folder / 'out', tmp_path / 'bag', PipelineSettings())

    job()
    (folder / 'out' / 'notes.txt').write_text('mine')
    code, steps = run_until(job, folder, r'os\.rename .*/fresh$')
    assert was_killed(code), steps
    assert not (folder / 'out').exists()
    check_results_folder(folder / 'out')
    assert (folder / 'out' / 'notes.txt').read_text() == 'mine'
    assert os.listdir(folder) == ['out']


def test_unfinished_results_of_another_folder_stay(tmp_path):
    for name in ('other', 'out'):
        code, _ = run_until(
            lambda name=name: write_results(
                analysis(), tmp_path / name, tmp_path / 'bag', PipelineSettings()
            ),
            tmp_path,
            r'os\.rename .*/fresh$',
        )
        assert was_killed(code)
    check_results_folder(tmp_path / 'out')
    (left,) = os.listdir(tmp_path)
    assert left.startswith('.other.')


def test_a_folder_without_a_name_is_refused_before_the_work(tmp_path, monkeypatch):
    write_results(analysis(), tmp_path / 'out', tmp_path / 'bag', PipelineSettings())
    monkeypatch.chdir(tmp_path / 'out')
    with pytest.raises(RecordingError, match=r'pass --output /.*/out$'):
        check_results_folder(Path())


def test_a_place_that_cannot_be_a_folder_is_refused_before_the_work(tmp_path):
    (tmp_path / 'file').write_text('mine')
    (tmp_path / 'link').symlink_to(tmp_path / 'nowhere')
    for path in (tmp_path / 'file' / 'out', tmp_path / 'link'):
        with pytest.raises(RecordingError, match='is no folder'):
            check_results_folder(path)
    assert (tmp_path / 'file').read_text() == 'mine'


def test_a_full_disk_names_the_folder_and_leaves_nothing(tmp_path):
    soft, hard = getrlimit(RLIMIT_FSIZE)
    setrlimit(RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(UnwritableError) as refused:
            write_results(analysis(), tmp_path / 'out', tmp_path / 'bag', PipelineSettings())
    finally:
        setrlimit(RLIMIT_FSIZE, (soft, hard))
    assert refused.value.where == str(tmp_path / 'out')
    assert 'cannot be written (File too large)' in refused.value.what
    assert list(tmp_path.iterdir()) == []


def full_analysis():
    """With a record of every kind."""
    analysed = analysis()
    for product in MEASURED:
        if not analysed.trays[5].of(product.record):
            values = np.ones(len(layout(product.record).elements))
            analysed.trays[5].add(
                from_array(product.record, values, tray=5, epoch_ns=0, where='test')
            )
    return analysed


def test_every_table_has_the_columns_and_types_of_its_description_in_pandas(tmp_path):
    pandas = pytest.importorskip('pandas')
    write_results(full_analysis(), tmp_path / 'out', tmp_path / 'bag', PipelineSettings())
    package = json.loads((tmp_path / 'out' / PACKAGE).read_text())
    tables = {path.name for path in (tmp_path / 'out').glob('*.csv')}
    assert {resource['path'] for resource in package['resources']} == tables
    checks = {
        'number': pandas.api.types.is_float_dtype,
        'integer': pandas.api.types.is_integer_dtype,
        'boolean': pandas.api.types.is_bool_dtype,
        'string': pandas.api.types.is_string_dtype,
    }
    for resource in package['resources']:
        frame = pandas.read_csv(tmp_path / 'out' / resource['path'])
        fields = resource['schema']['fields']
        assert list(frame.columns) == [field['name'] for field in fields]
        for field in fields:
            column = frame[field['name']]
            assert checks[field['type']](column) or column.isna().all(), field
            words = field.get('constraints', {}).get('enum')
            assert words is None or set(column) <= set(words)


def test_every_kind_of_result_goes_into_the_bag_and_into_the_tables(tmp_path):
    analysed = full_analysis()
    write_results(analysed, tmp_path / 'results', tmp_path / 'bag', PipelineSettings())
    bag = open_bag(tmp_path / 'results' / 'results_bag')
    assert bag.complete
    tables = {path.stem.removeprefix('tray_5_') for path in (tmp_path / 'results').glob('*.csv')}
    assert {topic.rpartition('/')[2] for topic in bag.topics} == {*tables, 'epoch'}
    assert len(tables) == len(MEASURED)


def test_records_that_came_in_another_order_stand_by_their_stamps_in_the_bag(tmp_path):
    came = [3, 1, 2, 7, 5, 7, 4, 6, 9, 8]
    merges = [
        Merge(
            stamp_ns=stamp * NS,
            known_ns=10 * NS,
            tray=5,
            cycle=1,
            tracks=np.array([number, 99], dtype=np.int32),
            joins=True,
        )
        for number, stamp in enumerate(came)
    ]
    analysed = Analysis(epoch_ns=0, trays={5: TrayResults(merges)})
    write_results(analysed, tmp_path / 'results', tmp_path / 'bag', PipelineSettings())
    bag = open_bag(tmp_path / 'results' / 'results_bag')
    topic = topics.MERGE.absolute(5)
    stored = [
        from_array(Merge, bag.deserialize(message).data, tray=5, epoch_ns=0, where=topic)
        for message in bag.messages([topic])
    ]
    assert [merge.stamp_ns // NS for merge in stored] == sorted(came)
    # Those of one stamp as they came in.
    order = sorted(range(len(came)), key=came.__getitem__)
    assert [merge.tracks.tolist() for merge in stored] == [[number, 99] for number in order]


def test_tables_in_parquet_are_put_together_of_pieces(tmp_path):
    pytest.importorskip('pyarrow')
    from pyarrow import parquet

    speeds = [replace(SPEED, stamp_ns=number * NS) for number in range(2500)]
    analysed = Analysis(epoch_ns=0, trays={5: TrayResults(speeds)})
    write_results(analysed, tmp_path / 'out', tmp_path / 'bag', PipelineSettings(), 'parquet')
    table = parquet.read_table(tmp_path / 'out' / 'tray_5_speed.parquet')
    assert table['time'].to_pylist() == list(range(2500))


def test_a_cycle_that_a_merge_ended_in_hindsight_is_one_cycle_and_a_second_pass_is_another():
    cooling, final = CorStatus.COOLING, CorStatus.FINAL
    course = [
        *((1, 5.0 + 0.5 * k, cooling) for k in range(5)),
        (1, 5.6, final),
        *((2, 65.0 + 0.5 * k, cooling) for k in range(3)),
        (2, 65.2, CorStatus.UNDETERMINED),
        (1, 5.0, cooling),
        (1, 5.4, final),
        (1, 5.0, cooling),
    ]
    cors = [
        replace(COR, cycle=cycle, stamp_ns=round(time * NS), status=status)
        for cycle, time, status in course
    ]
    last = [
        (estimate.cycle, estimate.stamp_ns / NS, estimate.status)
        for estimate in last_of_each_cycle(cors)
    ]
    assert last == [course[5], course[9], course[11], course[12]]
