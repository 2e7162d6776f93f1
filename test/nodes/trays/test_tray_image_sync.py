"""Tray images are assembled from their parts, in whatever order these arrive."""

from itertools import permutations

import numpy as np
import pytest

from nanorocks_ros.nodes.trays.tray_image_sync import TrayImageSync
from nanorocks_ros.records import Frame, Quality, TrayImage, TrayState
from nanorocks_ros.wire.array_layouts import from_array, to_array

EPOCH = 1_700_000_000_000_000_000
STEP = 33_333_333
THREE_DAYS = 3 * 86_400 * 10**9


def image_of(number, *, color=True):
    gray = np.full((4, 6), number, dtype=np.uint8)
    return TrayImage(
        stamp_ns=EPOCH + THREE_DAYS + number * STEP,
        tray=3,
        gray=gray,
        color=np.dstack([gray] * 3) if color else None,
        cycle=2,
        cycle_start_ns=EPOCH + THREE_DAYS - 10 * 10**9,
        noise_power=8.0,
        displacement=(1e-4, -2e-4),
        displacement_error=1e-6,
        velocity=(1e-3, 0.0),
        velocity_error=1e-5,
        quality=Quality.GLARE,
        glare=0.25,
    )


def pushed(sync, image, part):
    """The images that are complete after a part of one, as it travels, was added."""
    if part == 'state':
        values = to_array(image.state(), EPOCH)
        state = from_array(TrayState, values, tray=3, epoch_ns=EPOCH, where='test')
        return sync.add_state(state)
    pixels = getattr(image, part)
    encoding = 'mono8' if part == 'gray' else 'bgr8'
    return getattr(sync, f'add_{part}')(
        Frame(stamp_ns=image.stamp_ns, encoding=encoding, image=pixels)
    )


def assert_alike(image, expected):
    assert (image.stamp_ns, image.tray, image.cycle) == (expected.stamp_ns, 3, 2)
    assert image.quality == expected.quality
    np.testing.assert_array_equal(image.gray, expected.gray)
    assert (image.color is None) == (expected.color is None)
    assert image.displacement == pytest.approx(expected.displacement, rel=1e-6)
    assert image.velocity == pytest.approx(expected.velocity, rel=1e-6)
    assert abs(image.cycle_start_ns - expected.cycle_start_ns) < 1000


@pytest.mark.parametrize('order', list(permutations(['state', 'gray', 'color'])))
def test_the_parts_may_come_in_any_order(order):
    sync = TrayImageSync()
    for number in range(5):
        image = image_of(number)
        complete = [result for part in order for result in pushed(sync, image, part)]
        assert len(complete) == 1
        assert_alike(complete[0], image)


def test_a_gray_camera_is_not_waited_for():
    sync = TrayImageSync()
    image = image_of(1, color=False)
    assert pushed(sync, image, 'gray') == []
    assert_alike(pushed(sync, image, 'state')[0], image)


@pytest.mark.parametrize('lost', ['state', 'gray', 'color'])
def test_an_image_of_which_a_part_is_lost_is_left_out_and_the_next_one_comes(lost):
    sync = TrayImageSync()
    complete = []
    for number in range(6):
        for part in ('state', 'color', 'gray'):
            if not (number == 2 and part == lost):
                complete += pushed(sync, image_of(number), part)
    assert [int(image.gray[0, 0]) for image in complete] == [0, 1, 3, 4, 5]


def test_states_far_ahead_of_their_pixels_find_them():
    sync = TrayImageSync()
    images = [image_of(number) for number in range(20)]
    for part in ('state', 'color'):
        assert not any(pushed(sync, image, part) for image in images)
    complete = [result for image in images for result in pushed(sync, image, 'gray')]
    assert [result.stamp_ns for result in complete] == [image.stamp_ns for image in images]


@pytest.mark.parametrize('order', list(permutations(['state', 'gray', 'color'])))
def test_after_a_seek_back_no_image_is_taken_for_lost(order):
    """Some parts of the first images arrive before any of the others."""
    sync = TrayImageSync()
    for number in range(100, 140):
        for part in order:
            pushed(sync, image_of(number), part)
    images = [image_of(number) for number in range(3)]
    complete = [
        result for part in order for image in images for result in pushed(sync, image, part)
    ]
    assert [int(result.gray[0, 0]) for result in complete] == [0, 1, 2]
