"""Tray images in messages of any publisher, as frames that stages and browsers can use."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.messages.image_messages import frame_from_image

if TYPE_CHECKING:
    from sensor_msgs.msg import Image

    from nanorocks_ros.records import Frame


def gray_frame(message: Image, where: str) -> Frame:
    """An image of one channel.

    Parameters
    ----------
    message : sensor_msgs/Image
    where : str
        The topic, for errors.

    Raises
    ------
    FrameError
        For other encodings than mono8, and as `frame_from_image`.
    """
    frame = frame_from_image(message, where)
    if frame.encoding != 'mono8':
        raise FrameError(
            where, f"encoding '{frame.encoding}' where gray is expected", 'publish it as mono8'
        )
    # Few publishers pad rows, and the kernels are compiled for rows without padding.
    return replace(frame, image=np.ascontiguousarray(frame.image))


def color_frame(message: Image, where: str) -> Frame:
    """An image of the channels blue, green and red, in this order.

    Raises
    ------
    FrameError
        For other encodings than bgr8 and rgb8, and as `frame_from_image`.
    """
    frame = gray_or_bgr_frame(message, where)
    if frame.encoding != 'bgr8':
        raise FrameError(
            where,
            f"encoding '{frame.encoding}' where colour is expected",
            'publish it as bgr8 or rgb8; do not publish it for a gray camera',
        )
    return replace(frame, image=np.ascontiguousarray(frame.image))


def gray_or_bgr_frame(message: Image, where: str) -> Frame:
    """An image in gray, or of the channels blue, green and red.

    Raises
    ------
    FrameError
        As `frame_from_image`.
    """
    frame = frame_from_image(message, where)
    if frame.encoding != 'rgb8':
        return frame
    image = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
    return replace(frame, encoding='bgr8', image=np.asarray(image, dtype=np.uint8))
