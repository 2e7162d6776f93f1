"""Which bead of a frame is which of the frames before, and medians over beads."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.bead_paths import (
    Moment,
    column_medians,
    links_from,
    paths_of,
    positions_at,
)


def test_paths_are_those_of_beads_seen_in_all_frames_whatever_their_rows():
    rng = np.random.default_rng(1)
    count, frames = 12, 7
    places = rng.uniform(0.0, 100.0, (frames, count, 2))
    moments, last = deque(), np.empty((0, 1), np.int32)
    orders = [rng.permutation(count)[: count - 2] for _ in range(frames)]
    for frame, order in enumerate(orders):
        before = np.full(order.size, -1)
        if frame:
            for row, bead in enumerate(order):
                earlier = np.flatnonzero(orders[frame - 1] == bead)
                before[row] = earlier[0] if earlier.size else -1
        last = links_from(before, last)
        moments.append(Moment(frame, places[frame, order], 1.0 * order, last, np.zeros(2)))
    lags = (0, 2, 5)
    positions, radii = paths_of(positions_at(moments, lags), last, lags, moments[-1].radii)
    always = [bead for bead in orders[-1] if all(bead in order for order in orders[-6:])]
    assert radii.tolist() == always
    assert (positions == places[[6, 4, 1]][:, always]).all()


@pytest.mark.parametrize('count', [1, 2, 5, 8])
def test_medians_of_columns_are_those_of_numpy(count):
    values = np.random.default_rng(count).normal(size=(count, 2))
    assert (column_medians(values) == np.median(values, axis=0)).all()
