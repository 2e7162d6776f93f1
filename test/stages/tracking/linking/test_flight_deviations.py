"""Errors of places learnt from straight paths, against those that were drawn."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.linking.flight_deviations import (
    FlightDeviations,
    add_places,
    straight_variance,
)

BEADS = 30
RATE = 30.0
STATED = 0.04


def smooth_errors(rng, error, alike):
    """Errors of two coordinates at each place of a line, alike over a length, (pixels, 2)."""
    size, step = 4000, 0.25
    kernel = np.exp(-0.5 * (np.arange(-4.0 * alike, 4.0 * alike, step) / (alike / 2.0)) ** 2)
    noise = rng.normal(size=(size + kernel.size - 1, 2))
    smooth = np.stack([np.convolve(column, kernel, mode='valid') for column in noise.T], axis=1)
    return error * smooth / smooth.std(), step


def learnt(error, *, alike=0.0, radius=8.0, mean_free_path=np.inf, seconds=12.0, speed=40.0):
    """What is learnt of beads whose stated error is `STATED`; deflected at random."""
    rng = np.random.default_rng(3)
    deviations = FlightDeviations(radius, assumed=0.09)
    positions = rng.uniform(0.0, 400.0, (BEADS, 2))
    velocities = rng.normal(0.0, speed, (BEADS, 2))
    paths, lines = rng.uniform(0.0, 100.0, BEADS), []
    if alike:
        lines = [smooth_errors(rng, error, alike) for _ in range(BEADS)]
    for frame in range(int(seconds * RATE)):
        steps = np.hypot(*velocities.T) / RATE
        paths += steps
        deflected = rng.random(BEADS) < steps / mean_free_path
        velocities[deflected] = rng.normal(0.0, speed, (int(deflected.sum()), 2))
        positions = positions + velocities / RATE
        wrong = (
            np.array([line[int(path / step) % len(line)]
                      for (line, step), path in zip(lines, paths, strict=True)])
            if lines
            else rng.normal(0.0, error, (BEADS, 2))
        )  # fmt: skip
        add_places(
            deviations.paths, frame / RATE, np.arange(BEADS, dtype=np.int32), positions + wrong,
            np.full(BEADS, STATED),
        )  # fmt: skip
    return deviations


@pytest.mark.parametrize('error', [0.02, 0.1, 0.6])
@pytest.mark.parametrize('mean_free_path', [np.inf, 60.0])
def test_white_errors_are_learnt_though_beads_collide(error, mean_free_path):
    factor, rest = learnt(error, mean_free_path=mean_free_path).scaling
    assert factor * STATED == pytest.approx(error, rel=0.2)
    assert rest == 0.0


def test_errors_that_neighbouring_places_share_are_learnt_over_longer_paths():
    known = learnt(0.2, alike=2.0, speed=15.0).known()
    lengths, factors = zip(*known, strict=True)
    assert list(lengths) == [1.0, 2.0, 4.0, 8.0]
    assert factors[0] * STATED < 0.7 * 0.2
    assert factors[-1] * STATED == pytest.approx(0.2, rel=0.25)


def test_nothing_is_learnt_of_beads_at_rest():
    scaling = learnt(0.1, speed=0.0).scaling
    assert scaling == (1.0, 0.09)


def test_deflected_paths_are_told_from_straight_ones():
    rng = np.random.default_rng(5)
    straight = 0.3 * rng.normal(size=(300, 2))
    deflected = rng.normal(0.0, 5.0, (200, 2))
    squares = (np.concatenate([straight, deflected]) ** 2).sum(axis=1)
    assert straight_variance(squares) == pytest.approx(0.09, rel=0.2)


def test_too_few_straight_paths_tell_nothing():
    rng = np.random.default_rng(6)
    paths = np.concatenate([0.1 * rng.normal(size=(100, 2)), rng.normal(0.0, 5.0, (400, 2))])
    assert np.isnan(straight_variance((paths**2).sum(axis=1)))
