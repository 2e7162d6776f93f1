"""Tray images of any publisher become frames in mono8 or bgr8, or are refused."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.base.communication.ros_messages import image_message
from nanorocks_ros.nodes.trays.tray_image_messages import (
    color_frame,
    gray_frame,
    gray_or_bgr_frame,
)

NS = 1_000_000_000
RED = np.zeros((40, 40, 3), np.uint8)
RED[..., 0] = 255


def test_colours_are_converted_to_blue_green_red():
    message = image_message(NS, 'x', RED, 'rgb8')
    for read in (color_frame, gray_or_bgr_frame):
        frame = read(message, 'where')
        assert frame.encoding == 'bgr8'
        assert frame.image[20, 20].tolist() == [0, 0, 255]
    assert gray_or_bgr_frame(image_message(NS, 'x', RED[..., 0]), 'where').encoding == 'mono8'


def test_gray_where_colour_is_expected_is_refused_and_vice_versa():
    with pytest.raises(FrameError, match=r"where: encoding 'bgr8' .* publish it as mono8"):
        gray_frame(image_message(NS, 'x', RED), 'where')
    with pytest.raises(FrameError, match=r"encoding 'mono8' .* publish it as bgr8 or rgb8"):
        color_frame(image_message(NS, 'x', RED[..., 0]), 'where')


def test_padding_of_rows_is_removed():
    pixels = np.arange(40 * 48, dtype=np.uint8).reshape(40, 48)
    message = image_message(NS, 'x', pixels)
    message.width = 41
    image = gray_frame(message, 'where').image
    assert image.flags.c_contiguous
    assert np.array_equal(image, pixels[:, :41])
