"""A campaign cycle by cycle, from the results of its recordings."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from campaigns import PEAK, SIZE, write_recording

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.records import (
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.cycle_summaries import SIZE_MEASURES, cycles_of
from nanorocks_ros.studies.analysis.long_term import in_period, read_campaign, write_campaign
from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.studies.analysis.results.results_folder import write_results


@pytest.fixture(scope='module')
def folders(tmp_path_factory):
    """Three recordings of 12 cycles; clusters are larger in cycles 19 to 24 of all."""
    root = tmp_path_factory.mktemp('campaign')
    sizes = SIZE * (1.0 + 0.05 * np.random.default_rng(4).normal(size=36))
    sizes[18:24] *= 1.4
    return [
        write_recording(root / f'r{k}', (1, 3), 12, sizes[12 * k : 12 * (k + 1)], seed=k)
        for k in range(3)
    ]


def test_every_cycle_of_every_recording_has_its_place(folders):
    campaign = read_campaign(folders)
    assert campaign.trays == (1, 3)
    assert campaign.places == 36
    assert len(campaign.cycles) == 72
    last = campaign.cycles[-1]
    assert (last.recording, last.cycle, last.place, last.tray) == ('r2', 12, 35, 3)
    assert last.start == 661.0


def test_peak_restitution_and_size_are_those_of_the_tables(folders):
    for cycle in read_campaign(folders[:1]).cycles:
        assert cycle.peak_speed == pytest.approx(PEAK)
        assert cycle.peak_speed_error == pytest.approx(1e-4)
        assert (cycle.restitution, cycle.restitution_lower, cycle.restitution_upper) == (
            0.89,
            0.87,
            0.91,
        )
        assert SIZE * 0.8 < cycle.cluster_size < SIZE * 1.2
        assert 0.0 < cycle.cluster_size_error < 1e-3 * SIZE


def test_the_period_of_larger_clusters_is_found(folders):
    campaign = read_campaign(folders)
    (period,) = campaign.periods
    assert (period.first, period.last) == (18, 23)
    assert in_period(campaign, 20)
    assert not in_period(campaign, 30)


def test_a_trend_of_peaks_is_that_which_was_put_in(tmp_path):
    peaks = 0.005 + 1e-5 * np.arange(20)
    folder = write_recording(tmp_path / 'r', (1,), 20, np.full(20, SIZE), peaks=peaks)
    trends = read_campaign([folder]).trends
    assert trends[1, 'peak_speed'].slope == pytest.approx(1e-5)
    assert trends[1, 'restitution'].slope == 0.0
    assert math.isnan(trends[1, 'restitution'].slope_error)


def test_beads_of_bodies_are_preferred_where_all_recordings_have_them(tmp_path):
    sizes = np.full(6, SIZE)
    with_bodies = write_recording(tmp_path / 'a', (1,), 6, sizes, bodies=True)
    without = write_recording(tmp_path / 'b', (1,), 6, sizes)
    campaign = read_campaign([with_bodies])
    assert campaign.measure.column == 'weighted_size'
    assert campaign.cycles[0].cluster_size == pytest.approx(6.0, rel=1e-3)
    # The error of one count is that of all: they are of the same bodies.
    assert campaign.cycles[0].cluster_size_error == 0.5
    assert read_campaign([with_bodies, without]).measure.column == 'correlation_length'


def test_a_size_that_is_known_in_no_cycle_of_a_tray_is_not_taken(tmp_path):
    folder = write_recording(tmp_path / 'a', (1, 3), 6, np.full(6, SIZE), bodies=True)
    table = folder / 'tray_3_bodies.csv'
    header, *lines = table.read_text().splitlines()
    lines = [','.join([*line.split(',')[:2], 'nan', 'nan']) for line in lines]
    table.write_text('\n'.join([header, *lines]) + '\n')
    assert read_campaign([folder]).measure.column == 'correlation_length'


def test_a_tray_that_missed_a_shaking_event_keeps_in_step(tmp_path):
    folder = write_recording(tmp_path / 'r', (1,), 3, np.full(3, SIZE))
    table = folder / 'tray_1_speed.csv'
    lines = table.read_text().splitlines(keepends=True)
    (folder / 'tray_3_speed.csv').write_text(
        ''.join(line for line in lines if line.split(',')[1] != '2')
    )
    campaign = read_campaign([folder])
    assert campaign.places == 3
    assert np.isnan(campaign.values(3, 'peak_speed')).tolist() == [False, True, False]
    assert np.isnan(campaign.values(3, 'cluster_size')).all()


def test_the_table_holds_every_cycle(folders, tmp_path):
    campaign = read_campaign(folders)
    write_campaign(campaign, tmp_path / 'all.csv')
    columns = read_columns(tmp_path / 'all.csv', ('place', 'tray', 'cluster_size', 'quiet'))
    assert columns['place'].tolist() == [cycle.place for cycle in campaign.cycles]
    assert columns['quiet'].sum() == 12
    assert columns['cluster_size'][0] == campaign.cycles[0].cluster_size


def test_recordings_without_a_shaking_event_are_refused(tmp_path):
    folder = write_recording(tmp_path / 'r', (1,), 0, [])
    with pytest.raises(RecordingError, match='no cycle after a shaking event'):
        read_campaign([folder])


def test_a_recording_that_is_named_twice_is_refused(folders):
    with pytest.raises(ConfigurationError, match='twice'):
        read_campaign([folders[0], folders[1], folders[0]])


def test_a_folder_that_holds_no_results_is_named(tmp_path):
    with pytest.raises(RecordingError, match='holds no tray_K_speed'):
        read_campaign([tmp_path])


def test_speeds_measured_at_a_wrong_scale_are_no_peaks(tmp_path):
    def speed(time, cycle, quality):
        return SpeedEstimate(
            stamp_ns=round(time * 1e9),
            tray=1,
            cycle=cycle,
            cycle_start_ns=cycle * 60_000_000_000,
            mean_projected_speed=Measured(PEAK, 1e-4),
            window=0.1,
            method=SpeedMethod.TRACKING,
            quality=quality,
        )

    speeds = [
        *(speed(61.0 + k, 1, Quality.WRONG_SCALE | Quality.UNCERTAIN) for k in range(3)),
        *(speed(121.0 + k, 2, Quality.UNCERTAIN) for k in range(3)),
    ]
    analysis = Analysis(epoch_ns=0, trays={1: TrayResults(speeds)})
    write_results(analysis, tmp_path / 'results', Path('bag'), PipelineSettings())
    first, second = cycles_of(tmp_path / 'results', 1, SIZE_MEASURES[-1])
    assert math.isnan(first.peak_speed)
    assert second.peak_speed == pytest.approx(PEAK)
