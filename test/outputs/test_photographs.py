"""Words in pictures can be read on any ground."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.outputs.photographs import write_words


@pytest.mark.parametrize('ground', [0, 128, 255])
def test_words_stand_on_a_black_ground(ground):
    picture = np.full((60, 200, 3), ground, np.uint8)
    write_words(picture, '2 mm', (20, 40), 0.7, (255, 255, 255))
    words = picture[20:45, 18:90]
    assert (words == 0).all(axis=2).mean() > 0.4
    assert words.max() == 255
    assert (picture[:, 150:] == ground).all()
