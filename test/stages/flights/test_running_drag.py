"""The drag that flights are straightened with."""

from __future__ import annotations

import pytest
from bent_flights import bent_flights

from nanorocks_ros.records import Measured
from nanorocks_ros.stages.flights.running_drag import RunningDrag

WIDE = Measured(0.0, 0.2)


def test_flights_with_a_drag_set_it():
    running = RunningDrag(WIDE)
    assert running.drag == 0.0
    assert running.push(0.0, bent_flights(300, 0.02))
    assert running.drag == pytest.approx(0.02, abs=0.002)


def test_a_drag_that_chance_explains_is_not_used():
    running = RunningDrag(WIDE)
    assert not running.push(0.0, bent_flights(300, 0.0))
    assert running.drag == 0.0


def test_it_is_renewed_once_a_second():
    running = RunningDrag(WIDE)
    running.push(0.0, bent_flights(300, 0.02))
    before = running.drag
    assert not running.push(0.5, bent_flights(300, 0.1, seed=2))
    assert running.drag == before
    assert running.push(1.1, ())
    assert running.drag > before


def test_a_known_drag_stays():
    running = RunningDrag(Measured(0.05, 0.0))
    assert not running.push(0.0, bent_flights(300, 0.02))
    assert running.drag == 0.05
