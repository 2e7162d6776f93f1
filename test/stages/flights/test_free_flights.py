"""Records of free flights in the tracks of a tray, and the drag of its species."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.flights.free_flights import free_flight
from nanorocks_ros.stages.flights.relative_drag import (
    mean_relative_drag,
    relative_drag,
    relative_drags,
)


def test_a_flight_is_dated_at_its_end_with_its_drag_and_chi_square():
    tray = load_trays()[1]
    bend = np.array([2.0, 1.0, 31.0, 4e-3, -1e-3, -8e-5, 2e-5, 1e-5, 112.0])
    fit = SimpleNamespace(track=7, species=0, radius=2e-3, bend=bend)
    flight = free_flight(tray, fit, 10**10, 2e-6)
    assert flight.stamp_ns == 12_500_000_000
    assert flight.temperature == 2e-6
    assert (flight.track, flight.points, flight.duration) == (7, 31, 1.0)
    np.testing.assert_array_equal(flight.mean_velocity, [4e-3, -1e-3])
    np.testing.assert_array_equal(flight.mean_acceleration, [-8e-5, 2e-5])
    assert flight.reduced_chi_square == pytest.approx(112.0 / 56.0)
    # Twice the radius of a bead of tray 1: a quarter of the drag.
    assert flight.relative_drag == pytest.approx(0.25, rel=1e-6)


def test_light_and_small_beads_are_slowed_more():
    tray = load_trays()[3]
    acrylic, glass = tray.species
    expected = (acrylic.density * acrylic.diameter**2) / (glass.density * glass.diameter**2)
    np.testing.assert_allclose(relative_drags(tray), [1.0, expected])
    assert relative_drag(tray, 1, 0.25 * glass.diameter) == pytest.approx(4.0 * expected)
    mean = (acrylic.count + expected * glass.count) / tray.count
    assert mean_relative_drag(tray) == pytest.approx(mean)
