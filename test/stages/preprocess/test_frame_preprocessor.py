"""Frames in, tray images out; what cannot be used is refused in one line."""

from __future__ import annotations

import numpy as np
import pytest
from plates import GROWING_FLOOR

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import Frame, Notice, Quality, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

NS = 1_000_000_000


def preprocessor(**values):
    settings = with_values(PipelineSettings(), values, 'test')
    return Preprocessor(settings, trays_of(settings), '/camera')


def frame(stamp_ns=0, encoding='bgr8', size=(240, 320), seed=0):
    shape = size if encoding == 'mono8' else (*size, 3)
    pixels = np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)
    return Frame(stamp_ns=stamp_ns, encoding=encoding, image=pixels)


def test_a_single_tray_is_cropped_from_the_centre():
    first = frame()
    (image,) = preprocessor().push(first)
    side = round(15e-3 * 13500)
    top, left = (240 - side) // 2, (320 - side) // 2
    assert image.gray.shape == (side, side)
    assert np.array_equal(image.color, first.image[top : top + side, left : left + side])


def test_the_gray_mix_is_the_weighted_sum_of_the_channels():
    first = frame()
    (image,) = preprocessor(**{'preprocess.gray_mix': [0.2, 0.5, 0.3]}).push(first)
    expected = image.color.astype(float) @ np.array([0.2, 0.5, 0.3])
    assert np.abs(image.gray - expected).max() <= 0.51


def test_rgb_and_bgr_frames_of_one_scene_give_the_same_tray():
    first = frame()
    swapped = Frame(stamp_ns=0, encoding='rgb8', image=first.image[:, :, ::-1].copy())
    (from_bgr,) = preprocessor().push(first)
    (from_rgb,) = preprocessor().push(swapped)
    assert np.array_equal(from_bgr.gray, from_rgb.gray)
    assert np.array_equal(from_bgr.color, from_rgb.color)


def test_a_gray_camera_gives_gray_trays_without_colour():
    first = frame(encoding='mono8')
    (image,) = preprocessor().push(first)
    assert image.color is None
    assert image.gray.shape == (202, 202)


def test_several_trays_come_in_the_order_of_their_regions():
    regions = [0, 0, 60, 40, 100, 20, 50, 30]
    both = preprocessor(**{'trays': [2, 1], 'preprocess.regions_px': regions})
    images = both.push(frame())
    assert [(image.tray, image.gray.shape) for image in images] == [(2, (40, 60)), (1, (30, 50))]


def test_records_cannot_be_written_to():
    (image,) = preprocessor().push(frame())
    with pytest.raises(ValueError, match='read-only'):
        image.gray[0, 0] = 1


@pytest.mark.parametrize('encoding', ['bayer_rggb8', 'mono16', '', 'bgra8'])
def test_an_unknown_encoding_is_refused_with_those_that_do(encoding):
    message = r"^/camera: encoding '.*' is not supported; publish bgr8, rgb8, mono8$"
    pixels = frame().image
    with pytest.raises(FrameError, match=message):
        preprocessor().push(Frame(stamp_ns=0, encoding=encoding, image=pixels))


def test_a_frame_whose_size_changes_is_refused_and_the_next_good_one_is_not():
    stage = preprocessor()
    stage.push(frame(0))
    message = r'^/camera: the frame size changed from 320x240 to 300x240 px; '
    with pytest.raises(FrameError, match=message):
        stage.push(frame(NS, size=(240, 300)))
    assert isinstance(stage.push(frame(2 * NS))[0], TrayImage)


def test_a_frame_smaller_than_the_tray_is_refused():
    with pytest.raises(FrameError, match=r'tray 1 .* does not lie inside the 100x100 px frame'):
        preprocessor().push(frame(size=(100, 100)))


def test_a_zoom_is_said_once_and_flagged():
    stage = preprocessor(
        **{
            'preprocess.pixels_per_metre': 9000.0,
            'preprocess.regions_px': list(GROWING_FLOOR.floor),
            'preprocess.check_tray_positions': False,
        }
    )
    said, images = [], []
    for number in range(150):
        picture = GROWING_FLOOR.picture(number, 0.0002)
        records = stage.push(Frame(stamp_ns=number * NS // 30, encoding='bgr8', image=picture))
        said += [record.text for record in records if isinstance(record, Notice)]
        images += [record for record in records if isinstance(record, TrayImage)]
    assert [text for text in said if 'zoom' in text] == [
        'tray 1: its size in the picture changes, so that no scale holds for all frames; results '
        'carry DOUBTFUL_SCALE; hold zoom and focus, and the camera'
    ]
    assert Quality.DOUBTFUL_SCALE in images[-1].quality
    assert Quality.DOUBTFUL_SCALE not in images[60].quality


@pytest.mark.parametrize('late_ns', [0, NS // 30, NS // 2])
def test_a_frame_that_comes_a_little_late_is_dropped_and_that_is_said(late_ns):
    stage = preprocessor()
    stage.push(frame(10 * NS))
    (notice,) = stage.push(frame(10 * NS - late_ns))
    assert isinstance(notice, Notice)
    assert 'late and was dropped' in notice.text
    assert isinstance(stage.push(frame(10 * NS + 1, seed=1))[0], TrayImage)


def test_time_that_goes_back_is_a_loop_and_that_is_said():
    stage = preprocessor()
    stage.push(frame(10 * NS))
    notice, image = stage.push(frame(2 * NS))
    assert notice.text == '/camera: time went back by 8.000 s; starting afresh'
    assert image.stamp_ns == 2 * NS


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'trays': [9]}, r'trays: 9 is outside \[1, 8\]'),
        ({'trays': [1, 2]}, 'empty, with 2 trays'),
        ({'preprocess.regions_px': [0, 0, 10]}, '3 numbers for 1 trays'),
        ({'preprocess.gray_mix': [1.0, 1.0, 1.0]}, 'whose sum is above 0 and at most 1'),
        ({'preprocess.gray_mix': [0.0, 0.0, 0.0]}, 'whose sum is above 0 and at most 1'),
        ({'preprocess.gray_mix': [0.5, 0.5]}, 'three weights'),
    ],
)
def test_settings_that_do_not_fit_are_refused(values, message):
    with pytest.raises(ConfigurationError, match=message):
        preprocessor(**values)
