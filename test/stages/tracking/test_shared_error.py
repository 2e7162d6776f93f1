"""The error that all beads of a frame share, against the one that was drawn."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.bead_paths import Moment, links_from
from nanorocks_ros.stages.tracking.shared_error import SharedError

BEADS = 40
FRAMES = 60


def measured(times, shared, speed=30.0, own=0.03):
    """Errors after each frame; beads fly straight and keep their rows."""
    rng = np.random.default_rng(0)
    start, velocity = rng.uniform(0.0, 400.0, (BEADS, 2)), rng.normal(0.0, speed, (BEADS, 2))
    meter, moments = SharedError(), deque(maxlen=5)
    errors = []
    for time, offset in zip(times, shared, strict=True):
        positions = start + velocity * time + offset + rng.normal(0.0, own, (BEADS, 2))
        rows = np.arange(BEADS) if moments else np.full(BEADS, -1)
        links = links_from(rows, moments[-1].links if moments else np.empty((0, 1), np.int32))
        moments.append(Moment(time, positions, np.full(BEADS, 4.0), links, np.zeros(2)))
        meter.push(moments)
        errors.append(meter.error)
    return np.array(errors)


@pytest.mark.parametrize('rate', [15.0, 60.0])
def test_an_error_that_all_beads_share_is_measured(rate):
    shared = np.random.default_rng(1).normal(0.0, 0.15, (FRAMES, 2))
    errors = measured(np.arange(FRAMES) / rate, shared)
    assert errors[FRAMES // 2 :].mean() == pytest.approx(0.15, rel=0.25)


def test_errors_of_their_own_and_a_swing_are_none_that_beads_share():
    times = np.arange(FRAMES) / 25.0
    swing = 3.0 * np.sin(2.0 * np.pi * 1.5 * times)[:, None] * [0.8, 0.6]
    assert measured(times, swing)[FRAMES // 2 :].max() < 0.02


def test_frames_at_uneven_times_say_nothing():
    times = np.cumsum(np.tile([1.0, 2.0], FRAMES // 2)) / 60.0
    shared = np.random.default_rng(1).normal(0.0, 0.15, (FRAMES, 2))
    assert not measured(times, shared).any()
