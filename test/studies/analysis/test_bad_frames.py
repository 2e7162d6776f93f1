"""Recordings with frames that cannot be used: what is left is analysed, and all of it is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.calibration import Calibration, CameraInfo, rectified_view
from nanorocks_ros.experiment.calibration_file import write_calibration
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    camera_info_message,
    image_message,
    time_message,
)
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.wire import topics

NS = 1_000_000_000
SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'


def picture(number):
    pixels = np.random.default_rng(number).integers(90, 110, (210, 210), dtype=np.uint8)
    pixels[50:70, 20 + number % 150 : 40 + number % 150] = 200
    return pixels


def bag_of(path, pictures, rate=30, info=None):
    """A bag of gray pictures, with what is told of the lens where anything is."""
    names = (topics.EPOCH, topics.RAW, topics.CAMERA_INFO)
    with BagWriter(
        path, {name.absolute(): offered_topic(name) for name in names}, metadata={}
    ) as bag:
        bag.write(topics.EPOCH.absolute(), NS, time_message(NS))
        if info is not None:
            message = camera_info_message(
                NS, 'camera', (info.width, info.height), info.k, (info.distortion_model, info.d)
            )
            bag.write(topics.CAMERA_INFO.absolute(), NS, message)
        for number, pixels in enumerate(pictures):
            stamp_ns = NS + number * NS // rate
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    return path


def lens(model='equidistant', size=210):
    matrix = np.array([[900.0, 0.0, 104.5], [0.0, 900.0, 104.5], [0.0, 0.0, 1.0]])
    return CameraInfo(width=size, height=size, distortion_model=model, d=(0.0,) * 4, k=matrix)


def test_frames_stored_twice_count_once_and_the_lags_are_those_of_the_film(tmp_path):
    twice = [picture(k // 2) for k in range(120)]
    analysis = analyse(bag_of(tmp_path / 'bag', twice, rate=60), PipelineSettings())
    assert analysis.frames == 60
    assert analysis.frames_lost == 0
    assert any('60 frames were stored twice and left out' in notice for notice in analysis.notices)


def test_black_frames_in_the_middle_are_a_gap(tmp_path):
    pictures = [np.zeros((210, 210), np.uint8) if 30 <= k < 40 else picture(k) for k in range(70)]
    analysis = analyse(bag_of(tmp_path / 'bag', pictures), PipelineSettings())
    assert analysis.frames == 60
    assert analysis.frames_lost == 10
    assert any('the picture is black' in notice for notice in analysis.notices)
    assert any('10 blank frames were left out' in notice for notice in analysis.notices)
    assert {cluster.cycle for cluster in analysis.trays[1].clusters} == {0}


def test_a_recording_that_is_black_throughout_is_refused(tmp_path, capsys):
    path = bag_of(tmp_path / 'bag', [np.zeros((210, 210), np.uint8)] * 20)
    assert main(['analyse', str(path), '--no-output']) == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert 'no frame can be used' in line
    assert str(path) in line


def test_without_a_lens_the_picture_is_taken_as_straight_and_that_is_said(tmp_path):
    pictures = [picture(k) for k in range(10)]
    without = analyse(bag_of(tmp_path / 'without', pictures), PipelineSettings())
    with_one = analyse(bag_of(tmp_path / 'with', pictures, info=lens()), PipelineSettings())
    notices = [
        [notice for notice in analysis.notices if 'free of distortion' in notice]
        for analysis in (without, with_one)
    ]
    assert len(notices[0]) == 1
    assert 'neither camera_info nor a calibration file' in notices[0][0]
    assert notices[1] == []


def test_a_lens_that_is_not_known_is_refused_with_the_remedy(tmp_path, capsys):
    path = bag_of(tmp_path / 'bag', [picture(0)], info=lens('fov'))
    with pytest.raises(RecordingError, match="distortion model 'fov' is not supported"):
        BagFrames(path).view()
    assert main(['analyse', str(path), '--no-output']) == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.endswith('calibrate for equidistant or plumb_bob, or set preprocess.calibration')


def test_a_calibration_file_replaces_a_lens_that_is_not_known(tmp_path):
    path = bag_of(tmp_path / 'bag', [picture(k) for k in range(10)], info=lens('fov'))
    file = tmp_path / 'lens.yaml'
    info = replace(lens(), k=tuple(lens().k.ravel()))
    calibration = Calibration(
        info=info,
        view=rectified_view(info, 'test'),
        regions={1: Region(11, 11, 188, 188)},
        pixels_per_metre=12503.25,
        residual_px=0.125,
    )
    write_calibration(calibration, file, 'made by a test')
    settings = with_values(PipelineSettings(), {'preprocess.calibration': str(file)}, 'test')
    images = [image for shot in BagImages(path, settings).shots() for image in shot.images]
    assert len(images) == analyse(path, settings).frames == 10


def test_a_lens_of_pictures_of_another_size_is_refused(tmp_path, capsys):
    path = bag_of(tmp_path / 'bag', [picture(0)], info=lens(size=420))
    assert main(['analyse', str(path), '--no-output']) == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert 'the frame is 210x210 px, the calibration of the camera for 420x420 px' in line


def changed_sample(path, topic, number, change):
    """The first 90 frames of the sample bag, one message of a topic changed."""
    source, seen = open_bag(SAMPLE), 0
    names = [topics.RAW_COMPRESSED.absolute(), topics.TRUTH.absolute(1)]
    table = {
        names[0]: offered_topic(topics.RAW_COMPRESSED),
        names[1]: offered_topic(topics.TRUTH),
    }
    with BagWriter(path, table, metadata={}) as bag:
        for message in source.messages(names, end_ns=source.start_ns + 3 * NS):
            content = bytes(message.cdr)
            seen += message.topic == topic
            if message.topic == topic and seen == number:
                content = change(content)
            bag.write_raw(message.topic, message.log_time_ns, content)
    return path


def test_one_message_that_is_none_costs_one_frame(tmp_path):
    name = topics.RAW_COMPRESSED.absolute()
    path = changed_sample(tmp_path / 'bag', name, 40, lambda content: content[:20])
    analysis = analyse(path, PipelineSettings())
    whole = analyse(
        changed_sample(tmp_path / 'whole', name, 0, lambda content: content), PipelineSettings()
    )
    assert analysis.refused == 1
    assert analysis.frames == whole.frames - 1
    assert not analysis.complete
    assert any('1 frames could not be used' in notice for notice in analysis.notices)


def test_a_first_message_that_is_none_does_not_take_the_epoch_away(tmp_path):
    name = topics.RAW_COMPRESSED.absolute()
    path = changed_sample(tmp_path / 'bag', name, 1, lambda content: content[:6])
    assert BagFrames(path).epoch_ns() > NS
    assert analyse(path, PipelineSettings()).refused == 1


def test_a_message_of_the_truth_that_is_none_is_told_and_the_rest_is_taken(tmp_path):
    name = topics.TRUTH.absolute(1)
    path = changed_sample(tmp_path / 'bag', name, 5, lambda content: content[:30])
    analysis = analyse(path, PipelineSettings())
    assert analysis.refused == 0
    assert len(analysis.trays[1].truth) > 20
    assert any('1 messages of the truth cannot be used' in notice for notice in analysis.notices)


def without_stamps(path, frames):
    names = (topics.RAW,)
    with BagWriter(
        path, {name.absolute(): offered_topic(name) for name in names}, metadata={}
    ) as bag:
        for number in range(30):
            stamp_ns = 0 if number in frames else NS + number * NS // 30
            message = image_message(stamp_ns, 'camera', 'mono8', picture(number))
            bag.write(topics.RAW.absolute(), NS + number * NS // 30, message)
    return path


def test_frames_without_a_stamp_are_refused_and_set_no_epoch(tmp_path, capsys):
    analysis = analyse(without_stamps(tmp_path / 'bag', {0, 7}), PipelineSettings())
    assert analysis.refused == 2
    assert analysis.epoch_ns == NS + NS // 30
    assert analysis.seconds < 1.0
    path = without_stamps(tmp_path / 'none', range(30))
    assert main(['analyse', str(path), '--no-output']) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert 'a frame has no time stamp; configure the camera driver to stamp its frames' in line
