"""Messages refuse arrays that do not fit them."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.recordings.messages.message_builders import (
    float_array_message,
    image_message,
    time_message,
)


@pytest.mark.parametrize('stamp_ns', [0, 1, 999_999_999, 1_000_000_000, 1_700_000_000_000_000_001])
def test_a_time_keeps_every_nanosecond(stamp_ns):
    message = time_message(stamp_ns)
    assert message.sec * 1_000_000_000 + message.nanosec == stamp_ns
    assert 0 <= message.nanosec < 1_000_000_000


def test_an_array_needs_a_value_for_each_label():
    with pytest.raises(RecordingError, match=r'time,cycle: values of shape \(1,\) for 2 labels'):
        float_array_message(['time', 'cycle'], [1.0])


@pytest.mark.parametrize(('encoding', 'image'), [
    ('bgr8', np.zeros((4, 4), np.uint8)),
    ('mono8', np.zeros((4, 4, 3), np.uint8)),
    ('mono8', np.zeros((4, 4), np.float32)),
    ('32FC1', np.zeros((4, 4), np.float64)),
    ('mono8', np.zeros(4, np.uint8)),
])  # fmt: skip
def test_an_image_that_does_not_fit_its_encoding_is_refused(encoding, image):
    with pytest.raises(FrameError, match=f'does not fit {encoding}; give'):
        image_message(0, 'camera', encoding, image)


def test_an_image_of_an_unknown_encoding_is_refused():
    with pytest.raises(FrameError, match=r"encoding '16UC1' is not supported"):
        image_message(0, 'camera', '16UC1', np.zeros((4, 4), np.uint8))


def test_a_view_of_an_array_is_sent_without_the_rest():
    image = np.arange(100, dtype=np.uint8).reshape(10, 10)
    message = image_message(0, 'camera', 'mono8', image[2:4, 3:6])
    assert message.data.tolist() == [23, 24, 25, 33, 34, 35]
    assert message.step == 3
