"""Intermediate images of the preprocessing of one frame, and the command that draws them."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import NS, MotionMask
from nanorocks_ros.settings import (
    CompressionSettings,
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.inspection.preprocessing_steps import steps_of_bag
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder
from nanorocks_ros.wire import topics

FRAMES = 18
SCALE = 7500.0
FLAGS = ['--preprocess-layout', 'plate', '--preprocess-pixels-per-metre', str(SCALE)]


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Trays 1 and 3 through the lens, on a swinging plate."""
    path = tmp_path_factory.mktemp('steps') / 'bag'
    simulation = SimulationSettings(width_px=800, height_px=640, first_shake=0.1)
    scene = with_values(
        SceneSettings(trays=(1, 3), pixels_per_metre=SCALE), {'swing': 0.0006}, 'test'
    )
    recorder = SceneRecorder(simulation, scene, FRAMES / simulation.frame_rate)
    recorder.into_bag(path, CompressionSettings(), 90, lambda done, total: None)
    return path


@pytest.fixture(scope='module')
def settings():
    names = {
        'trays': [1, 3],
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
    }
    return with_values(PipelineSettings(), names, 'test')


@pytest.fixture(scope='module')
def steps(bag, settings):
    return steps_of_bag(bag, settings, number=FRAMES - 1)


def test_the_mask_and_the_tracks_are_those_of_the_analysis(bag, settings, steps):
    estimator = TrayMeasurement(settings, load_trays()[3])
    estimator.emit_mask = True
    masks = [
        record
        for shot in BagImages(bag, settings).shots()
        for image in shot.images
        if image.tray == 3
        for record in estimator.push(image)
        if isinstance(record, MotionMask)
    ]
    np.testing.assert_array_equal(steps.trays[3].mask, masks[-1].mask)
    moving = np.count_nonzero(masks[-1].mask) / SCALE**2
    assert steps.trays[3].moving_area == pytest.approx(moving)
    tracked = track_bag(bag, settings).tracks[3][-1]
    np.testing.assert_array_equal(steps.trays[3].tracks.positions, tracked.positions)


def test_moving_pixels_differ_by_more_than_the_threshold(steps):
    tray = steps.trays[1]
    despeckled = cv2.medianBlur(tray.difference, 3)
    smallest = despeckled[tray.mask == 255].min()
    assert smallest > despeckled[tray.mask == 0].max()
    assert smallest > 5.0 * np.sqrt(tray.image.noise_power)


def test_only_the_stabilised_image_is_free_of_the_swing(steps):
    tray = steps.trays[1]
    shift = np.array(tray.image.displacement) * SCALE
    assert np.hypot(*shift) > 1.0
    rows, columns = tray.image.gray.shape
    moved = cv2.warpAffine(
        tray.straight,
        np.array([[1.0, 0.0, -shift[0]], [0.0, 1.0, -shift[1]]]),
        (columns, rows),
        flags=cv2.INTER_LINEAR,
    )
    inner = (slice(6, -6), slice(6, -6))

    def difference(picture):
        return np.abs(picture[inner].astype(float) - tray.image.color[inner]).mean()

    assert difference(moved) < 0.3 * difference(tray.straight)


def test_the_outline_lies_in_the_frame_where_the_lens_shows_the_floor(steps):
    tray = steps.trays[3]
    size = np.array(tray.raw.shape[1::-1])
    assert (tray.outline >= 0).all()
    assert (tray.outline <= size).all()
    area = cv2.contourArea(tray.outline.astype(np.float32))
    assert 0.6 * tray.image.gray.size < area < tray.image.gray.size


def test_darkness_is_darkest_where_beads_are(steps):
    tray = steps.trays[1]
    columns, rows = (tray.tracks.positions[tray.tracks.seen] * SCALE).astype(int).T
    assert np.median(tray.darkness[rows, columns]) > 5 * np.median(tray.darkness)


def test_the_first_frame_has_no_difference_yet(bag, settings):
    first = steps_of_bag(bag, settings, number=0)
    assert first.trays[1].mask is None
    assert first.trays[1].moving_area is None
    assert first.time == 0.0


def test_a_time_selects_the_first_frame_after_it(bag, settings):
    assert steps_of_bag(bag, settings, time=0.31).number == 10
    assert steps_of_bag(bag, settings).number == FRAMES // 2


def test_the_command_draws_eight_panels_for_each_tray(bag, tmp_path, capsys):
    picture = tmp_path / 'steps.png'
    call = ['look', str(bag), '--trays', '1', '3', *FLAGS, '-o', str(picture)]
    assert main([*call, '--frame', '15', '--json']) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed['frame'], list(printed['trays'])) == (15, ['1', '3'])
    tray = printed['trays']['3']
    assert (tray['cycle'], tray['expected']) == (1, 55)
    assert tray['seen'] > 40
    assert tray['moving_area'] > 0.0
    drawn = cv2.imread(str(picture))
    # Panels are images with white between them.
    row = (drawn[drawn.shape[0] // 8] < 250).any(axis=1)
    assert np.count_nonzero(np.diff(row.astype(int)) == 1) >= 4
    assert main([*call, '--frame', '0']) == 1
    assert 'exists already' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('flags', 'message'),
    [
        (['--frame', '18'], '--frame: 18, but the recording has 18 frames'),
        (['--at', '60'], '--at: 60 s, but the recording has 18 frames'),
        (['--at', 'nan'], '--at: nan; count from 0'),
        (['--frame', '-1'], '--frame: -1; count from 0'),
        (['-o', 'steps.jpg'], 'ends in none of .png'),
        (['--trays', '9'], '9 is outside'),
    ],
)
def test_an_impossible_request_is_reported_in_one_line(bag, capsys, flags, message):
    assert main(['look', str(bag), *FLAGS, *flags]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count('\n') == 1


def test_an_unusable_frame_is_reported_in_one_line(tmp_path, capsys):
    names = (topics.EPOCH, topics.RAW)
    path = tmp_path / 'black'
    rng = np.random.default_rng(1)
    with BagWriter(
        path, {name.absolute(): offered_topic(name) for name in names}, metadata={}
    ) as bag:
        bag.write(topics.EPOCH.absolute(), NS, time_message(NS))
        for number in range(5):
            pixels = rng.integers(90, 110, (210, 210, 3), dtype=np.uint8)
            stamp_ns = NS + number * NS // 30
            dark = np.zeros_like(pixels) if number == 3 else pixels
            message = image_message(stamp_ns, 'camera', 'bgr8', dark)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    assert main(['look', str(path), '--frame', '3']) == 1
    printed = capsys.readouterr().err
    assert 'frame 3: cannot be used; choose another frame' in printed
    assert printed.count('\n') == 1
    assert main(['look', str(path), '--frame', '4', '--json']) == 0
