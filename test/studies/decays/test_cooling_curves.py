"""Cycles from tables of speeds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from decays import simulated_table, write_rows

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.records import (
    NS,
    Measured,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.results_folder import write_results
from nanorocks_ros.studies.decays.cooling_curves import (
    check_errors,
    cooling_part,
    mean_cycle,
    read_cycles,
    read_decay,
    speed_table,
)

LAW = [(0.1 * k, 0.01 / (1.0 + 0.1 * k)) for k in range(1, 30)]


def cycle(number, start, factor=1.0, error=1e-4):
    return [(start + age, number, start, factor * speed, error, 0.3) for age, speed in LAW]


def test_each_shaking_event_opens_a_cycle(tmp_path):
    path = write_rows(tmp_path / 'tray_1_speed.csv', cycle(1, 3.0) + cycle(2, 63.0, 2.0))
    first, second = read_cycles(path)
    assert (first.cycle, second.cycle) == (1, 2)
    assert first.times == pytest.approx([age for age, _ in LAW])
    assert second.speed == pytest.approx(2.0 * first.speed)


def test_a_recording_played_twice_holds_its_cycles_twice(tmp_path):
    path = write_rows(tmp_path / 'a.csv', cycle(1, 3.0) + cycle(1, 103.0))
    assert [cycle.cycle for cycle in read_cycles(path)] == [1, 1]


def test_what_is_before_the_first_shake_or_not_known_is_left_out(tmp_path):
    before = [(0.1 * k, 0, math.nan, 0.001, 1e-4, 0.3) for k in range(5)]
    unknown = [(3.05, 1, 3.0, math.nan, math.nan, 0.3)]
    (speeds,) = read_cycles(write_rows(tmp_path / 'a.csv', before + unknown + cycle(1, 3.0)))
    assert speeds.times.size == len(LAW)


def test_the_mean_over_cycles_has_the_error_of_a_mean(tmp_path):
    rows = [row for k in range(4) for row in cycle(k + 1, 60.0 * k, 1.0 + 0.1 * k)]
    curve = mean_cycle(read_cycles(write_rows(tmp_path / 'a.csv', rows)), 0.5, 2.0)
    assert curve.cycles == 4
    assert curve.times == pytest.approx(np.arange(0.5, 2.05, 0.1))
    assert curve.speed == pytest.approx(1.15 * 0.01 / (1.0 + curve.times), rel=1e-6)
    assert curve.error == pytest.approx(np.full(16, 0.5e-4))


def test_only_times_that_all_cycles_cover_count(tmp_path):
    rows = cycle(1, 0.0) + cycle(2, 60.0)[5:15]
    curve = mean_cycle(read_cycles(write_rows(tmp_path / 'a.csv', rows)))
    assert curve.times[0] == pytest.approx(0.6)
    assert curve.times[-1] == pytest.approx(1.5)


def test_cycles_without_common_times_are_an_error(tmp_path):
    rows = cycle(1, 0.0)[:6] + cycle(2, 60.0)[10:]
    with pytest.raises(RecordingError, match='in common'):
        mean_cycle(read_cycles(write_rows(tmp_path / 'a.csv', rows)))


def test_the_table_of_a_folder_is_found_by_its_tray(tmp_path):
    for number in (1, 3):
        write_rows(tmp_path / f'tray_{number}_speed.csv', cycle(1, 0.0))
    assert speed_table(tmp_path, 3) == (tmp_path / 'tray_3_speed.csv', 3)
    with pytest.raises(RecordingError, match='holds speeds of trays 1, 3; name one, as --tray 1'):
        speed_table(tmp_path)
    with pytest.raises(RecordingError, match='no speeds of tray 5'):
        speed_table(tmp_path, 5)


def test_a_folder_without_speeds_is_named(tmp_path):
    with pytest.raises(RecordingError, match='holds no speeds of a tray; name the results'):
        speed_table(tmp_path)
    below = tmp_path / 'tray_1'
    below.mkdir()
    write_rows(below / 'tray_1_speed.csv', cycle(1, 0.0))
    with pytest.raises(RecordingError, match=f'name {below}'):
        speed_table(tmp_path)


def test_a_table_is_not_taken_for_another_tray_than_its_name_says(tmp_path):
    table = write_rows(tmp_path / 'tray_1_speed.csv', cycle(1, 0.0))
    assert speed_table(table) == speed_table(table, 1) == (table, 1)
    with pytest.raises(ConfigurationError, match='is of tray 1; leave out --tray 3'):
        speed_table(table, 3)


def test_a_decay_is_read_from_a_table_of_cycles_or_of_one_curve(tmp_path):
    cycles = write_rows(tmp_path / 'tray_1_speed.csv', cycle(1, 3.0) + cycle(2, 63.0))
    names = ('time', 'mean_projected_speed')
    write_csv(tmp_path / 'curve.csv', float_columns(names, ('s', 'm/s')), LAW)
    from_cycles, from_curve = read_decay(cycles), read_decay(tmp_path / 'curve.csv')
    assert (from_cycles.cycles, from_curve.cycles) == (2, None)
    assert read_decay(tmp_path / 'tray_1_speed.csv').speed == pytest.approx(from_curve.speed)


def test_what_the_analysis_writes_can_be_read(tmp_path):
    epoch_ns = 7 * NS
    speeds = [
        SpeedEstimate(
            stamp_ns=epoch_ns + round((60.0 * k + age) * NS),
            tray=1,
            cycle=k,
            cycle_start_ns=epoch_ns + 60 * k * NS if k else None,
            mean_projected_speed=Measured(speed, 1e-4),
            window=0.3,
            method=SpeedMethod.TRACKING,
        )
        for k in range(3)
        for age, speed in LAW
    ]
    analysis = Analysis(epoch_ns=epoch_ns, trays={1: TrayResults(speeds)})
    write_results(analysis, tmp_path / 'results', Path('bag'), PipelineSettings())
    curve = read_decay(tmp_path / 'results')
    assert curve.cycles == 2
    assert curve.times == pytest.approx([age for age, _ in LAW], abs=1e-4)
    # Tables hold what goes over the wire, float32.
    assert curve.speed == pytest.approx([speed for _, speed in LAW], rel=1e-3)
    check_errors(curve)


@pytest.mark.parametrize('text', ['', 'time [s],cycle [1]\n1,2\n', 'a,b\nc,d\n', '\x00\xff'])
def test_what_is_no_table_of_cycles_is_refused(tmp_path, text):
    path = tmp_path / 'a.csv'
    path.write_text(text, encoding='latin-1')
    with pytest.raises(RecordingError, match='name the results of `nanorocks analyse`'):
        read_cycles(path)


def test_a_table_without_a_shake_is_refused(tmp_path):
    rows = [(0.1 * k, 0, math.nan, 0.001, 1e-4, 0.3) for k in range(50)]
    with pytest.raises(RecordingError, match='no decay after a shaking event'):
        read_cycles(write_rows(tmp_path / 'a.csv', rows))


def test_errors_that_are_not_known_are_refused_where_they_are_needed(tmp_path):
    path = write_rows(tmp_path / 'a.csv', cycle(1, 0.0, error=math.nan))
    with pytest.raises(RecordingError, match='not known'):
        check_errors(mean_cycle(read_cycles(path)))


def test_simulated_tables_hold_as_many_cycles_as_asked(tmp_path):
    assert len(read_cycles(simulated_table(tmp_path / 'a.csv', 3))) == 3


def test_times_can_count_from_when_the_gas_began_to_cool(tmp_path):
    cycles = read_cycles(simulated_table(tmp_path / 'a.csv', 2))
    cooling, span = cooling_part(cycles, (4.0, 20.0), 3.0)
    assert span == (1.0, 17.0)
    for cycle, later in zip(cycles, cooling, strict=True):
        assert later.times[0] == pytest.approx(0.0, abs=1e-9)
        assert later.speed[0] == cycle.speed[29]
        assert len(later.times) == len(later.speed) == len(later.error) == len(cycle.times) - 29
    # Who asks for earlier times gets them.
    cooling, span = cooling_part(cycles, (1.0, 20.0), 3.0)
    assert span == (0.0, 19.0)
    assert cooling[0].times[0] == pytest.approx(0.0, abs=1e-9)
    assert len(cooling[0].times) == len(cycles[0].times) - 9
