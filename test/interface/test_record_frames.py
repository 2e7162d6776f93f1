"""Records as DataFrames."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.interface.record_frames import frame_of, joined, with_column
from nanorocks_ros.records import Measured, Quality, SpeedEstimate, SpeedMethod
from nanorocks_ros.studies.results.record_columns import columns_of

NS = 10**9


def speed(time, **values):
    return SpeedEstimate(
        **{
            'stamp_ns': time * NS,
            'tray': 3,
            'cycle': 2,
            'cycle_start_ns': None,
            'mean_projected_speed': Measured(0.1, 0.01),
            'window': 0.5,
            'method': SpeedMethod.TRACKING,
            **values,
        }
    )


def test_columns_are_those_of_the_register_with_units_and_words():
    frame = frame_of(SpeedEstimate, [speed(12, quality=Quality.GLARE), speed(13)], 10 * NS)
    names = [column.name for column in columns_of(SpeedEstimate)]
    assert list(frame.columns) == ['tray', *names]
    assert list(frame.attrs['units']) == list(frame.columns)
    assert frame.attrs['units']['mean_projected_speed'] == 'm/s'
    assert frame['time'].tolist() == [2.0, 3.0]
    assert frame['method'].tolist() == ['tracking'] * 2
    assert frame['quality'].tolist() == ['glare', 'good']
    assert frame['cycle'].dtype == np.int64


def test_no_records_are_an_empty_frame_with_all_columns():
    empty = frame_of(SpeedEstimate, [], 0)
    assert len(empty) == 0
    assert list(empty.columns) == list(frame_of(SpeedEstimate, [speed(1)], 0).columns)
    assert joined([empty, empty], a=1).attrs['units']['time'] == 's'


def test_joined_frames_keep_units_and_kinds():
    parts = [frame_of(SpeedEstimate, [speed(k)] * (k > 0), 0) for k in (0, 1, 2)]
    whole = joined([with_column(part, 0, 'recording', 'a') for part in parts], probability=0.95)
    assert whole['time'].tolist() == [1.0, 2.0]
    assert whole['cycle'].dtype == np.int64
    assert whole.attrs['units']['recording'] == ''
    assert whole.attrs['probability'] == 0.95
