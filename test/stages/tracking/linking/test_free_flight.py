"""Line fits to free flights, and collisions that end them."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.stages.tracking.linking.free_flight import MAX_POINTS, extend_flight


class _Flight:
    def __init__(self, window=2.0):
        self.times, self.positions = np.zeros(MAX_POINTS), np.zeros((MAX_POINTS, 2))
        self.errors, self.line = np.zeros(MAX_POINTS), np.zeros(9)
        self.count, self.window = 0, window

    def add(self, time, x, y, error=0.1):
        self.count = extend_flight(
            self.times, self.positions, self.errors, self.count, self.line,
            time, x, y, error, self.window,
        )  # fmt: skip


def test_the_velocity_of_a_straight_flight_has_the_stated_error():
    rng = np.random.default_rng(1)
    pulls = []
    for _ in range(300):
        flight = _Flight()
        for k in range(12):
            x, y = rng.normal((30.0 * k / 30.0, -12.0 * k / 30.0), 0.1)
            flight.add(k / 30.0, x, y)
        if flight.count == 12:
            pulls.append((flight.line[3:5] - (30.0, -12.0)) / np.sqrt(flight.line[6]))
    assert len(pulls) > 250
    assert np.std(pulls) == pytest.approx(1.0, abs=0.15)


def test_a_collision_starts_a_new_flight_with_the_velocity_after_it():
    flight = _Flight()
    for k in range(10):
        flight.add(k / 30.0, 2.0 * k, 0.0)
    for k in range(10):
        flight.add((10 + k) / 30.0, 18.0, 3.0 * (k + 1))
    assert flight.count <= 11
    assert flight.line[3] == pytest.approx(0.0, abs=3.0)
    assert flight.line[4] == pytest.approx(90.0, abs=3.0)


def test_a_flight_is_never_longer_than_the_window():
    flight = _Flight(window=0.2)
    for k in range(30):
        flight.add(k / 30.0, k, 0.0)
    assert flight.times[0] - flight.times[flight.count - 1] <= 0.2
