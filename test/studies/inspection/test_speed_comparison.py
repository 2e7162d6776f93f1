"""Comparison of the speeds by every method with the truth, and its command."""

from __future__ import annotations

import csv
import json
import math

import cv2
import numpy as np
import pytest
from picture_colours import colours_of

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import (
    NS,
    GroundTruth,
    Measured,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.inspection import speed_comparison as study
from nanorocks_ros.studies.inspection.speed_comparison import (
    AUTO,
    METHODS,
    ComparedSpeeds,
    compare_speeds,
)
from nanorocks_ros.studies.synthetic.film_bag import film_into_bag
from nanorocks_ros.wire import topics

SECONDS = 6.0


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('speeds') / 'bag'
    settings = SimulationSettings(width_px=210, height_px=210, first_shake=0.4)
    film_into_bag(path, settings, duration=SECONDS, quality=90, progress=lambda done, total: None)
    return path


@pytest.fixture(scope='module')
def bag_speeds(bag):
    return compare_speeds(bag, PipelineSettings())


def estimate(seconds, speed, window, cycle=1, method=SpeedMethod.TRACKING):
    return SpeedEstimate(
        stamp_ns=round(seconds * NS),
        tray=1,
        cycle=cycle,
        cycle_start_ns=0,
        mean_projected_speed=Measured(speed, 0.0),
        window=window,
        method=method,
    )


def truth(seconds, speed):
    return GroundTruth(
        stamp_ns=round(seconds * NS),
        tray=1,
        cycle=1,
        mean_projected_speed=speed,
        mean_speed=speed,
        bodies=15,
        restitution=0.9,
        wall_restitution=0.9,
        sticking_speed=0.0,
    )


@pytest.mark.parametrize('method', [AUTO, *METHODS])
def test_each_method_gives_the_same_speeds_as_alone(bag, bag_speeds, method):
    settings = with_values(PipelineSettings(), {'speed.method': method}, 'test')
    alone = analyse(bag, settings).trays[1].speeds
    # Compared as text, because NaN does not equal itself.
    assert [repr(speed) for speed in bag_speeds.trays[1].speeds[method]] == [
        repr(speed) for speed in alone
    ]


def test_tracking_and_structure_function_agree_with_the_truth(bag_speeds):
    tray = bag_speeds.trays[1]
    assert tray.ratios('tracking', 1).mean() == pytest.approx(1.0, abs=0.05)
    assert tray.ratios('structure_function', 1).mean() == pytest.approx(1.0, abs=0.15)
    assert tray.chosen(1) == {'tracking': 1.0, 'structure_function': 0.0, 'binarised_area': 0.0}
    assert bag_speeds.first_cycle() == 1


def test_the_truth_is_averaged_over_the_window_of_the_estimate():
    records = [truth(0.1 * k, float(k)) for k in range(10)]
    tray = ComparedSpeeds(tray=load_trays()[1], speeds={}, truth=records)
    estimates = [estimate(0.5, 1.0, 0.2), estimate(0.5, 1.0, 0.0), estimate(2.0, 1.0, 0.2)]
    assert tray.true_speeds(estimates)[:2].tolist() == pytest.approx([5.0, 5.0])
    assert tray.true_speeds([estimate(0.25, 1.0, 0.5)]).tolist() == pytest.approx([2.5])
    assert math.isnan(tray.true_speeds(estimates)[2])


def test_ratios_omit_unknown_values():
    speeds = {'tracking': [estimate(0.1, 3.0, 0.0), estimate(0.2, math.nan, 0.0)]}
    tray = ComparedSpeeds(tray=load_trays()[1], speeds=speeds, truth=[truth(0.1, 2.0)])
    assert tray.ratios('tracking').tolist() == [1.5]
    assert tray.ratios('tracking', cycle=2).size == 0
    without = ComparedSpeeds(tray=load_trays()[1], speeds=speeds)
    assert np.isnan(without.true_speeds(speeds['tracking'])).all()


def test_the_command_draws_one_cycle_and_writes_all_speeds(bag, bag_speeds, tmp_path, capsys):
    picture, table = tmp_path / 'speeds.png', tmp_path / 'speeds.csv'
    call = ['speeds', str(bag), '-o', str(picture), '--table', str(table)]
    assert main([*call, '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    tray = printed['trays']['1']
    assert set(tray['methods']) == {AUTO, *METHODS}
    tracking = tray['methods']['tracking']
    assert len(tracking['time']) == len(tracking['true_mean_projected_speed'])
    assert len(tracking['time']) == len(tracking['quality'])
    assert tracking['ratio_to_truth'] == pytest.approx(
        bag_speeds.trays[1].ratios('tracking').mean()
    )
    with table.open(encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    counts = {name: len(tray['methods'][name]['time']) for name in tray['methods']}
    assert len(rows) == sum(counts.values())
    assert {row['method'] for row in rows} == set(counts)
    drawn = cv2.imread(str(picture))
    # Tracking, structure function, selected speeds.
    assert {(0x73, 0x9E, 0x00), (0xB2, 0x72, 0x00), (0, 0, 0)} <= colours_of(drawn)
    assert main(call) == 1
    assert 'exists already' in capsys.readouterr().err


def test_a_missing_cycle_and_a_wrong_extension_are_usage_errors(bag, tmp_path, capsys):
    assert main(['speeds', str(bag), '--cycle', '7']) == 2
    assert '--cycle: 7, but speeds were measured in 0, 1' in capsys.readouterr().err
    assert main(['speeds', str(bag), '-o', str(tmp_path / 'speeds.pdf')]) == 2
    assert 'ends in none of .png' in capsys.readouterr().err
    assert main(['speeds', str(tmp_path / 'nowhere')]) == 1
    assert capsys.readouterr().err.count('\n') == 1


def test_a_gray_camera_at_rest_is_drawn_too(tmp_path, capsys):
    names = (topics.EPOCH, topics.RAW)
    path = tmp_path / 'gray'
    rng = np.random.default_rng(1)
    with BagWriter(
        path, {name.absolute(): offered_topic(name) for name in names}, metadata={}
    ) as bag:
        bag.write(topics.EPOCH.absolute(), NS, time_message(NS))
        for number in range(20):
            pixels = rng.integers(90, 110, (210, 210), dtype=np.uint8)
            stamp_ns = NS + number * NS // 30
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    assert main(['speeds', str(path), '-o', str(tmp_path / 'speeds.png')]) == 0
    printed = capsys.readouterr()
    assert 'tray 1, cycle 0:\n' in printed.out
    assert 'tracking: 0 speeds\n' in printed.out
    assert cv2.imread(str(tmp_path / 'speeds.png')) is not None


def test_an_interruption_reports_that_nothing_was_written(bag, tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(study, 'compare_speeds', interrupted)
    assert main(['speeds', str(bag), '-o', str(tmp_path / 'speeds.png')]) == 130
    assert 'interrupted; nothing was written' in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
