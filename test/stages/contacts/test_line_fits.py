"""Line fits: break points of bent paths, and the time at which two lines intersect."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.contacts.line_fits import best_break, fit_line, intersect_lines

ERROR = 4e-6


def _bent_path(times, at, before, after, seed=1):
    bend = np.where(times[:, None] < at, np.array(before), np.array(after))
    positions = 0.01 + bend * (times - at)[:, None]
    return positions + np.random.default_rng(seed).normal(0.0, ERROR, positions.shape)


def _position_at(line, time):
    return line.position + line.velocity * (time - line.time)


def test_the_break_of_a_bent_path_is_between_the_right_frames():
    times = np.arange(24) / 30.0
    for last in (3, 10, 20):
        positions = _bent_path(times, times[last] + 0.4 / 30.0, (3e-3, 1e-3), (-2e-3, 1e-3))
        first, gain = best_break(times, positions, np.full(24, ERROR), 2)
        assert first == last + 1
        assert gain > 1000.0


def test_a_break_does_not_improve_straight_paths():
    times = np.arange(24) / 30.0
    gains = [
        best_break(
            times, _bent_path(times, 0.0, (3e-3, 1e-3), (3e-3, 1e-3), seed), np.full(24, ERROR), 2
        )
        for seed in range(200)
    ]
    assert max(gain for _, gain in gains) < 30.0


def test_too_few_positions_have_no_break():
    assert best_break(np.arange(3.0), np.zeros((3, 2)), np.ones(3), 2) == (0, 0.0)


def test_a_line_has_the_stated_errors():
    times = np.arange(12) / 30.0
    lines = [
        fit_line(times, _bent_path(times, 0.0, (2e-3, 0.0), (2e-3, 0.0), seed), np.full(12, ERROR))
        for seed in range(400)
    ]
    velocities = np.array([line.velocity - (2e-3, 0.0) for line in lines])
    assert velocities.std() == pytest.approx(lines[0].velocity_variance ** 0.5, rel=0.1)
    positions = np.array([_position_at(line, 0.5) - (0.011, 0.01) for line in lines])
    lever = 0.5 - lines[0].time
    variance = lines[0].position_variance + lines[0].velocity_variance * lever**2
    assert positions.std() == pytest.approx(variance**0.5, rel=0.1)
    assert np.mean([line.chi_square for line in lines]) == pytest.approx(20.0, rel=0.1)


def test_lines_before_and_after_intersect_at_the_time_of_the_jump():
    times = np.arange(20) / 30.0
    at = 10.3 / 30.0
    misses = []
    for seed in range(200):
        positions = _bent_path(times, at, (3e-3, 1e-3), (-2e-3, 1e-3), seed)
        errors = np.full(20, ERROR)
        before = fit_line(times[:11], positions[:11], errors[:11])
        after = fit_line(times[11:], positions[11:], errors[11:])
        time, error, _ = intersect_lines(np.array([[before.row, after.row]]))
        misses.append((time - at) / error)
    assert np.std(misses) == pytest.approx(1.0, abs=0.2)
    assert abs(np.mean(misses)) < 0.3
