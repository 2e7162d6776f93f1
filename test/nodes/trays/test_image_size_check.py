"""A tray image of another size is refused, until the new size stays."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.errors import FrameError
from nanorocks_ros.nodes.trays.image_size_check import ImageSizeCheck
from nanorocks_ros.records import TrayImage


def test_another_size_is_refused():
    sizes = ImageSizeCheck('/gray')
    gray = np.zeros((20, 30), np.uint8)
    color = np.zeros((20, 31, 3), np.uint8)
    with pytest.raises(FrameError, match='30x20 px in gray, 31x20 px in colour'):
        sizes.has_changed(TrayImage(stamp_ns=1, tray=1, gray=gray, color=color))
    assert not sizes.has_changed(TrayImage(stamp_ns=1, tray=1, gray=gray))
    other = TrayImage(stamp_ns=2, tray=1, gray=gray.T)
    with pytest.raises(FrameError, match='/gray: the size changed from 30x20 px to 20x30 px'):
        sizes.has_changed(other)
    assert not sizes.has_changed(TrayImage(stamp_ns=3, tray=1, gray=gray, color=color[:, :30]))


def test_a_new_size_that_stays_is_accepted():
    sizes = ImageSizeCheck('/gray')
    gray = np.zeros((20, 30), np.uint8)
    sizes.has_changed(TrayImage(stamp_ns=1, tray=1, gray=gray))
    other = TrayImage(stamp_ns=2, tray=1, gray=gray.T)
    refused = 0
    for _ in range(20):
        try:
            if sizes.has_changed(other):
                break
        except FrameError:
            refused += 1
    assert 2 < refused < 15
    assert not sizes.has_changed(other)
    with pytest.raises(FrameError, match='from 20x30 px to 30x20 px'):
        sizes.has_changed(TrayImage(stamp_ns=1, tray=1, gray=gray))
