"""Frames from image messages of rosbags and rclpy, and errors that name the topic."""

from __future__ import annotations

from array import array
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from camera_pictures import ENCODINGS
from hypothesis import given
from hypothesis import strategies as st

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.messages.image_messages import (
    encode_jpeg,
    frame_from_compressed,
    frame_from_image,
)
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    image_message,
)

WHERE = '/nanorocks/camera/image_raw'
STAMP_NS = 1_700_000_000_123_456_789


def picture(height=6, width=8, channels=3):
    shape = (height, width, channels) if channels > 1 else (height, width)
    return np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)


@pytest.mark.parametrize(('encoding', 'channels'), [('bgr8', 3), ('rgb8', 3), ('mono8', 1)])
def test_a_frame_holds_the_pixels_the_stamp_and_the_encoding(encoding, channels):
    image = picture(channels=channels)
    frame = frame_from_image(image_message(STAMP_NS, 'camera', encoding, image), WHERE)
    assert np.array_equal(frame.image, image)
    assert frame.stamp_ns == STAMP_NS
    assert frame.encoding == encoding


def ros_image(image, encoding, padding=0):
    """A message as rclpy returns it: its data is an array.array."""
    height, width = image.shape[:2]
    rows = np.pad(image.reshape(height, -1), ((0, 0), (0, padding)), constant_values=99)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=5)),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=rows.shape[1],
        data=array('B', rows.tobytes()),
    )


@given(
    height=st.integers(1, 7),
    width=st.integers(1, 7),
    padding=st.integers(0, 9),
    encoding=st.sampled_from(['bgr8', 'mono8']),
)
def test_padded_rows_lose_their_padding(height, width, padding, encoding):
    image = picture(height, width, 3 if encoding == 'bgr8' else 1)
    message = ros_image(image, encoding, padding)
    frame = frame_from_image(message, WHERE)
    assert np.array_equal(frame.image, image)
    assert frame.stamp_ns == 1_000_000_005
    assert np.shares_memory(frame.image, np.frombuffer(message.data, dtype=np.uint8))


def test_pixels_are_not_copied():
    image = picture()
    message = image_message(1, 'camera', 'bgr8', image)
    assert np.shares_memory(message.data, image)
    assert np.shares_memory(frame_from_image(message, WHERE).image, image)


def test_an_unknown_encoding_is_refused():
    message = ros_image(picture(), 'bayer_rggb16')
    with pytest.raises(FrameError) as caught:
        frame_from_image(message, WHERE)
    text = str(caught.value)
    assert text.startswith(f"{WHERE}: encoding 'bayer_rggb16' is not supported (bgr8, rgb8, ")
    assert 'image_proc debayer_node' in text


@pytest.mark.parametrize('encoding', ENCODINGS)
def test_every_encoding_gives_the_same_picture(encoding):
    """A picture of one colour, so that no pattern and no subsampling loses anything."""
    bgr = np.empty((12, 16, 3), dtype=np.uint8)
    bgr[...] = 40, 90, 200
    sent, frame_encoding = ENCODINGS[encoding]
    pixels = np.ascontiguousarray(sent(bgr))
    frame = frame_from_image(ros_image(pixels.view(np.uint8).reshape(12, 16, -1), encoding), WHERE)
    assert frame.encoding == frame_encoding
    expected = {'bgr8': bgr, 'rgb8': bgr[:, :, ::-1], 'mono8': bgr[:, :, 1]}[frame_encoding]
    difference = frame.image.astype(int) - expected
    # YUV has rounding.
    assert np.abs(difference).max() <= (2 if encoding.startswith('yuv') else 0)


@pytest.mark.parametrize('wrong', [
    {'data': array('B', bytes(143))},
    {'data': array('B', bytes(145))},
    {'data': array('B')},
    {'step': 23},
    {'step': 25},
    {'width': 0},
    {'height': 0, 'data': array('B')},
    {'width': 9},
])  # fmt: skip
def test_sizes_that_do_not_fit_are_refused(wrong):
    message = ros_image(picture(), 'bgr8')
    vars(message).update(wrong)
    with pytest.raises(FrameError, match=r'bytes in rows of .* do not fit a .* bgr8 image'):
        frame_from_image(message, WHERE)


def smooth(channels=3):
    ramp = np.linspace(0, 200, 64).astype(np.uint8)
    image = np.broadcast_to(ramp, (48, 64))
    return np.ascontiguousarray(np.dstack([image] * channels)) if channels > 1 else image.copy()


@pytest.mark.parametrize('kind', [bytes, lambda content: array('B', content)])
@pytest.mark.parametrize(('channels', 'encoding'), [(3, 'bgr8'), (1, 'mono8')])
def test_a_jpeg_is_decoded_with_small_errors(kind, channels, encoding):
    image = smooth(channels)
    message = compressed_image_message(STAMP_NS, 'camera', 'jpeg', encode_jpeg(image, 95))
    message.data = kind(message.data.tobytes())
    frame = frame_from_compressed(message, WHERE)
    assert frame.encoding == encoding
    assert frame.stamp_ns == STAMP_NS
    assert np.abs(frame.image.astype(int) - image).max() < 8


def test_a_png_is_decoded_exactly():
    image = picture()
    content = cv2.imencode('.png', image)[1].tobytes()
    message = compressed_image_message(1, 'camera', 'bgr8; png compressed bgr8', content)
    assert np.array_equal(frame_from_compressed(message, WHERE).image, image)


def test_a_jpeg_padded_with_zeros_is_complete():
    content = encode_jpeg(smooth(), 90) + bytes(3)
    message = compressed_image_message(1, 'camera', 'jpeg', content)
    assert frame_from_compressed(message, WHERE).image.shape == (48, 64, 3)


@pytest.mark.parametrize('content', [b'', b'\xff\xd8', b'not an image', bytes(100)])
def test_bytes_that_are_not_an_image_are_refused(content):
    message = compressed_image_message(7, 'camera', 'jpeg', content)
    with pytest.raises(FrameError, match=rf'the image at 7 ns \({len(content)} bytes, format'):
        frame_from_compressed(message, WHERE)


def test_a_jpeg_cut_short_is_refused_wherever_it_is_cut():
    content = encode_jpeg(smooth(), 90)
    for cut in range(0, len(content), 7):
        message = compressed_image_message(7, 'camera', 'jpeg', content[:cut])
        with pytest.raises(FrameError):
            frame_from_compressed(message, WHERE)


def test_read_only_pictures_and_views_are_encoded():
    image = smooth()
    image.flags.writeable = False
    assert encode_jpeg(image[4:20, 8:40], 90).startswith(b'\xff\xd8')


@pytest.mark.parametrize('quality', [0, 101, -1])
def test_a_quality_out_of_range_is_refused(quality):
    with pytest.raises(FrameError, match='give a number from 1 to 100'):
        encode_jpeg(smooth(), quality)


@pytest.mark.parametrize('image', [
    np.zeros((4, 4), np.float32),
    np.zeros((4, 4, 2), np.uint8),
    np.zeros(4, np.uint8),
    np.zeros((0, 4), np.uint8),
])  # fmt: skip
def test_arrays_that_are_not_images_are_refused(image):
    with pytest.raises(FrameError, match='is not an image'):
        encode_jpeg(image, 90)


@pytest.mark.parametrize(
    ('stamp_ns', 'message'),
    [(0, 'a frame has no time stamp'), (-5_000_000_000, 'time stamp -5 s, before 1970')],
)
def test_a_frame_without_a_usable_stamp_is_refused_raw_and_compressed(stamp_ns, message):
    raw = image_message(stamp_ns, 'camera', 'mono8', smooth(1))
    jpeg = compressed_image_message(stamp_ns, 'camera', 'jpeg', encode_jpeg(smooth(), 90))
    for convert, image in ((frame_from_image, raw), (frame_from_compressed, jpeg)):
        with pytest.raises(FrameError, match=message) as refused:
            convert(image, WHERE)
        assert 'configure the camera driver to stamp its frames' in str(refused.value)


def test_the_size_of_an_image_is_limited_before_it_is_decoded():
    """A JPEG of some bytes that claims 60000 x 60000 pixels."""
    content = bytearray(encode_jpeg(np.zeros((16, 16, 3), np.uint8), 90))
    place = content.index(b'\xff\xc0') + 5
    content[place : place + 4] = b'\xea\x60\xea\x60'
    message = compressed_image_message(5, 'camera', 'jpeg', bytes(content))
    with pytest.raises(FrameError, match=r'^/camera: .*NANOROCKS_MAX_IMAGE_PIXELS'):
        frame_from_compressed(message, '/camera')
