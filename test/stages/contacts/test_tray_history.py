"""Velocity of a tray from its displacements in the frames."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, tracks_of

from nanorocks_ros.stages.contacts.oscillation_fit import SwingDecay
from nanorocks_ros.stages.contacts.tray_history import TrayHistory

TIMES = np.arange(120) / RATE


def _history_of(displacements):
    history = TrayHistory(144)
    beads = np.full((TIMES.size, 1, 2), 5e-3)
    for time, tracks in zip(TIMES, tracks_of(beads, displacements=displacements), strict=True):
        history.push(time, tracks)
    return history


def _jitter(seed):
    return np.random.default_rng(seed).normal(0.0, 0.01 * PIXEL, (TIMES.size, 2))


def test_the_velocity_of_a_swinging_tray_is_known_within_its_error():
    omega = 2.0 * math.pi * 1.5
    oscillation = 1e-4 * np.exp(-0.16 * TIMES) * np.sin(omega * TIMES)
    history = _history_of(np.outer(oscillation, (0.8, 0.6)) + _jitter(1))
    for time in np.linspace(1.7, 2.3, 13):
        slope = omega * np.cos(omega * time) - 0.16 * np.sin(omega * time)
        true = 1e-4 * math.exp(-0.16 * time) * slope * np.array((0.8, 0.6))
        velocity, error = history.velocity(time)
        assert np.abs(velocity - true).max() < 2.0 * error
        assert error < 0.15 * 1e-4 * omega


def test_the_velocity_of_a_tray_at_rest_is_within_the_noise():
    speeds = [_history_of(_jitter(seed)).velocity(2.0) for seed in range(20)]
    scatter = np.std([velocity for velocity, _ in speeds])
    errors = [error for _, error in speeds]
    assert scatter < np.mean(errors)
    assert np.mean(errors) < 0.05 * PIXEL * RATE


def test_a_tray_without_registration_is_at_rest():
    velocity, error = _history_of(np.zeros((TIMES.size, 2))).velocity(2.0)
    assert velocity == pytest.approx([0.0, 0.0])
    assert error == 0.0


def test_a_jerk_is_fitted_by_a_cubic():
    jerk = np.where(TIMES > 2.0, 3e-3 * (TIMES - 2.0), 0.0)
    jerk = jerk + np.where(TIMES > 2.6, 9e-3 * (TIMES - 2.6), 0.0)
    velocity, error = _history_of(np.outer(jerk, (1.0, 0.0)) + _jitter(1)).velocity(2.3)
    assert velocity[0] == pytest.approx(3e-3, abs=4.0 * error)
    assert error < 1e-3


def _swing(times):
    """Displacement and velocity of a swing that ceases, (frames, 2)."""
    omega, decay = 2.0 * math.pi * 1.5, 0.16
    size = 2e-4 * np.exp(-decay * times)
    slope = size * (omega * np.cos(omega * times) - decay * np.sin(omega * times))
    return np.outer(size * np.sin(omega * times), (0.8, 0.6)), np.outer(slope, (0.8, 0.6))


def _pulls_of_a_film(seen, true_velocity, times):
    """Errors of velocities over the stated ones, from the tenth second on."""
    history, pulls = TrayHistory(144), []
    beads = np.full((times.size, 1, 2), 5e-3)
    for number, tracks in enumerate(tracks_of(beads, displacements=seen)):
        history.push(times[number], tracks)
        middle = number - 60
        if times[middle] > 10.0 and middle % 10 == 0:
            velocity, error = history.velocity(times[middle])
            pulls.append((velocity - true_velocity[middle]) / error)
    return np.array(pulls)


def test_a_swing_that_a_codec_leaves_out_is_missed_within_the_error():
    times = np.arange(25 * 30) / RATE
    displacement, velocity = _swing(times)
    # Motion of less than half a pixel is not in the film, and larger motion lags behind.
    seen = np.zeros_like(displacement)
    for k in range(1, times.size):
        moved = np.hypot(*(displacement[k] - seen[k - 1])) > 0.5 * PIXEL
        seen[k] = displacement[k] if moved else seen[k - 1]
    noise = np.random.default_rng(2).normal(0.0, 0.005 * PIXEL, seen.shape)
    pulls = _pulls_of_a_film(seen + noise, velocity, times)
    assert np.sqrt(np.mean(pulls**2)) < 3.0


def test_another_swing_begins_the_memory_anew():
    swing = SwingDecay()
    for time in np.arange(0.0, 6.0, 0.3):
        swing.push(time, 1e-3 * math.exp(-0.3 * time))
    assert swing.speed(10.0) == pytest.approx(1e-3 * math.exp(-3.0))
    swing.push(20.0, 0.9e-3)
    assert swing.speed(21.0) == 0.0
    for time in np.arange(20.3, 23.0, 0.3):
        swing.push(time, 0.9e-3 * math.exp(-0.2 * (time - 20.0)))
    assert swing.speed(30.0) == pytest.approx(0.9e-3 * math.exp(-2.0))


def test_a_swing_that_does_not_cease_is_not_continued():
    swing = SwingDecay()
    for time in np.arange(0.0, 6.0, 0.3):
        swing.push(time, 1e-3 * (1.0 + 0.01 * time))
    assert swing.speed(10.0) == 0.0
