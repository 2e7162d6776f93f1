"""A bag of the scene holds the camera, its lens and the whole truth, as small as asked for."""

from __future__ import annotations

import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import (
    CompressionSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.simulation.plate_scene.scene_geometry import scene_camera
from nanorocks_ros.studies.synthetic.film_bag import START_NS
from nanorocks_ros.studies.synthetic.film_compression import H264Stream, compressed
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder
from nanorocks_ros.wire.array_layouts import from_array
from nanorocks_ros.wire.bead_truth import beads_from_array

SIMULATION = SimulationSettings(width_px=800, height_px=640, first_shake=0.1)
SCENE = SceneSettings(pixels_per_metre=7500.0, trays=(1, 4))
FRAMES = 6


def film():
    return SceneFilm(SIMULATION, SCENE)


def nothing(*_):
    pass


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('scene') / 'bag'
    recorder = SceneRecorder(SIMULATION, SCENE, FRAMES / SIMULATION.frame_rate)
    recorder.into_bag(path, CompressionSettings(), 90, nothing)
    messages = {}
    with AnyReader([path]) as reader:
        for connection, stamp_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            messages.setdefault(connection.topic, []).append((stamp_ns, message))
        messages['qos'] = {
            connection.topic: connection.ext.offered_qos_profiles[0].durability.name
            for connection in reader.connections
        }
    return messages


def test_the_bag_holds_the_camera_its_lens_the_epoch_and_the_truth_of_each_tray(bag):
    counts = {name: len(messages) for name, messages in bag.items() if name != 'qos'}
    trays = {f'/nanorocks/tray_{k}/{name}': FRAMES for k in (1, 4) for name in ('truth', 'beads')}
    assert counts == {
        '/nanorocks/camera/image_raw/compressed': FRAMES,
        '/nanorocks/camera/camera_info': 1,
        '/nanorocks/epoch': 1,
        **trays,
    }
    assert bag['qos']['/nanorocks/camera/camera_info'] == 'TRANSIENT_LOCAL'


def test_the_lens_in_the_bag_is_that_of_the_scene(bag):
    ((_, info),) = bag['/nanorocks/camera/camera_info']
    camera = scene_camera(SIMULATION, SCENE)
    assert (info.width, info.height, info.distortion_model) == (800, 640, 'equidistant')
    np.testing.assert_array_equal(info.k.reshape(3, 3), camera.matrix)
    np.testing.assert_array_equal(info.d, camera.distortion)


def test_the_truth_in_the_bag_is_that_of_the_film(bag):
    for k, moment in enumerate(film().moments(FRAMES, START_NS)):
        for truth, beads in zip(moment.trays, moment.beads, strict=True):
            stamp_ns, message = bag[f'/nanorocks/tray_{truth.tray}/truth'][k]
            assert stamp_ns == truth.stamp_ns
            back = from_array(
                GroundTruth, message.data, tray=truth.tray, epoch_ns=START_NS, where='bag'
            )
            assert back.cycle == truth.cycle
            assert back.mean_projected_speed == pytest.approx(truth.mean_projected_speed)
            stamp_ns, message = bag[f'/nanorocks/tray_{truth.tray}/beads'][k]
            assert message.layout.dim[1].size == len(beads.radii)
            recorded = beads_from_array(
                message.data, tray=truth.tray, epoch_ns=START_NS, where='bag'
            )
            np.testing.assert_allclose(recorded.positions, beads.positions, atol=1e-8)
            np.testing.assert_allclose(recorded.displacement, beads.displacement, atol=1e-10)


def test_the_pictures_in_the_bag_are_those_of_the_film(bag):
    for k, moment in enumerate(film().moments(3)):
        _, message = bag['/nanorocks/camera/image_raw/compressed'][k]
        image = cv2.imdecode(message.data, cv2.IMREAD_COLOR).astype(float)
        assert np.sqrt(np.mean((image - moment.frame.image) ** 2)) < 3.0


@pytest.mark.parametrize('rate', [60e6, 120e6])
def test_jpegs_of_a_rate_make_a_film_of_that_size(rate):
    compression = CompressionSettings(codec='jpeg_rate', rate=rate)
    made = compressed(film().moments(24), compression, quality=90, frame_rate=30.0)
    sizes = [len(jpeg) for _, jpeg in made]
    assert np.mean(sizes) * 1800 == pytest.approx(rate, rel=0.05)


def test_a_picture_is_the_last_frame_as_it_is(tmp_path):
    recorder = SceneRecorder(SIMULATION, SCENE, 0.2)
    recorder.into_picture(tmp_path / 'scene.png')
    expected = film().at(5, 0).frame.image
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / 'scene.png')), expected)


@pytest.mark.parametrize('codec', ['h264', 'h264_crf'])
def test_h264_keeps_the_frames_in_order_and_loses_detail(codec):
    pytest.importorskip('av')
    compression = CompressionSettings(codec=codec, rate=40e6, crf=24.0)
    moments = list(film().moments(20))
    made = list(compressed(iter(moments), compression, quality=95, frame_rate=30.0))
    assert [moment.frame.stamp_ns for moment, _ in made] == [
        moment.frame.stamp_ns for moment in moments
    ]
    for (after, jpeg), before in zip(made, moments, strict=True):
        assert after.beads == before.beads
        change = after.frame.image.astype(float) - before.frame.image
        assert 0.5 < np.sqrt(np.mean(change**2)) < 6.0
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        assert image.shape == before.frame.image.shape


def test_a_stream_of_h264_has_the_size_asked_for():
    pytest.importorskip('av')
    stream = H264Stream(CompressionSettings(codec='h264', rate=30e3 * 1800), 30.0)
    decoded = [image for moment in film().moments(45) for image in stream.push(moment.frame.image)]
    decoded += stream.finish()
    assert len(decoded) == 45
    assert stream.bytes_written / 45 == pytest.approx(30e3, rel=0.25)


def test_without_pyav_h264_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'av', None)
    recorder = SceneRecorder(SIMULATION, SCENE, 0.1)
    with pytest.raises(ConfigurationError, match=r'h264: needs PyAV.*pip install av'):
        recorder.into_bag(tmp_path / 'bag', CompressionSettings(codec='h264'), 90, nothing)
    assert not (tmp_path / 'bag').exists()


def test_what_cannot_be_filmed_leaves_nothing_behind(tmp_path):
    far = replace(SCENE, pixels_per_metre=20000.0)
    with pytest.raises(ConfigurationError, match='lies outside a picture'):
        SceneRecorder(SIMULATION, far, 0.1).into_bag(
            tmp_path / 'bag', CompressionSettings(), 90, nothing
        )
    assert not (tmp_path / 'bag').exists()
    with pytest.raises(ConfigurationError, match='--duration: 0'):
        SceneRecorder(SIMULATION, SCENE, 0.0)
    (tmp_path / 'bag').mkdir()
    with pytest.raises(RecordingError, match='exists already'):
        SceneRecorder(SIMULATION, SCENE, 0.1).into_bag(
            tmp_path / 'bag', CompressionSettings(), 90, nothing
        )
