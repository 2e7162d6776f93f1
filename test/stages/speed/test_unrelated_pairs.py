"""Images kept until two of them are unrelated, and what is learnt from them."""

from __future__ import annotations

import numpy as np

from nanorocks_ros.stages.speed.unrelated_pairs import UnrelatedPairs

UNRELATED_PX = 80.0


def image(number):
    return np.full((2, 2), number, dtype=np.uint8)


def test_two_images_are_a_pair_once_the_beads_moved_far_enough():
    pairs = UnrelatedPairs(UNRELATED_PX)
    made = []
    for number in range(60):
        if pairs.move(5.0):
            pair = pairs.push(image(number))
            made += [(number, *pair)] if pair else []
    assert len(made) > 3
    for number, earlier, path in made:
        assert path >= UNRELATED_PX
        assert 5.0 * (number - earlier[0, 0]) == path


def test_beads_at_rest_need_no_image_but_the_first():
    pairs = UnrelatedPairs(UNRELATED_PX)
    needed = [number for number in range(50) if pairs.move(0.0) and not pairs.push(image(number))]
    assert needed == [0]
