"""Pictures of trays as stages and browsers take them, whoever publishes them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings.messages.image_messages import frame_from_image


def gray_frame(message, where):
    """A picture of one channel.

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
    # Whoever pads rows is rare, and what is compiled is compiled for rows without.
    return replace(frame, image=np.ascontiguousarray(frame.image))


def color_frame(message, where):
    """A picture in blue, green and red, in this order.

    Raises
    ------
    FrameError
        For other encodings than bgr8 and rgb8, and as `frame_from_image`.
    """
    frame = picture_frame(message, where)
    if frame.encoding != 'bgr8':
        raise FrameError(
            where,
            f"encoding '{frame.encoding}' where colours are expected",
            'publish it as bgr8 or rgb8, or not at all for a gray camera',
        )
    return replace(frame, image=np.ascontiguousarray(frame.image))


def picture_frame(message, where):
    """A picture in gray, or in blue, green and red.

    Raises
    ------
    FrameError
        As `frame_from_image`.
    """
    frame = frame_from_image(message, where)
    if frame.encoding != 'rgb8':
        return frame
    image = cv2.cvtColor(frame.image, cv2.COLOR_RGB2BGR)
    return replace(frame, encoding='bgr8', image=image)


# So many pictures of a new size in a row, and it is the size.
_LASTING = 10


class OneSize:
    """Refuses pictures of a tray of another size than before: stages compare them by pixels.

    A size that stays is the new one: who sends the pictures was given other parameters.

    Parameters
    ----------
    where : str
        The topic, for errors.
    """

    def __init__(self, where):
        self._where = where
        self._shape = None
        self._other = None
        self._others = 0

    def changed(self, image):
        """Let a TrayImage pass; whether it is of a new size that has come to stay.

        Raises
        ------
        FrameError
            When its size differs from those before, or its colours from its gray.
        """
        shape = image.gray.shape
        if image.color is not None and image.color.shape[:2] != shape:
            raise FrameError(
                self._where,
                f'{_size(shape)} in gray, {_size(image.color.shape)} in colour',
                'publish both in one size',
            )
        if self._shape is None:
            self._shape = shape
        if shape == self._shape:
            self._others = 0
            return False
        self._others = self._others + 1 if shape == self._other else 1
        self._other = shape
        if self._others < _LASTING:
            raise FrameError(
                self._where,
                f'the size changed from {_size(self._shape)} to {_size(shape)}',
                'publish one size',
            )
        self._shape = shape
        return True


def _size(shape):
    return f'{shape[1]}x{shape[0]} px'
