"""Contacts and flights in the tracks of beads that a gas slows down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bead_paths import PIXEL, RATE, bounced, tracks_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.records import FreeFlight, Measured, Rebound
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder

TRAY = load_trays()[1]
DRAG, RESTITUTION, SPEED, AT = 0.05, 0.9, 4e-3, 0.55
TIMES = np.arange(36) / RATE


def _found(kind, drag, jitter=0.02 * PIXEL):
    """Results of a kind from a bead that rebounds in a gas: drag is a change of the clock."""
    clock = -np.expm1(-DRAG * TIMES) / DRAG
    at = -math.expm1(-DRAG * AT) / DRAG
    tracks = tracks_of(bounced(clock, SPEED, RESTITUTION, at=at), jitter=jitter)
    finder = ContactFinder(TRAY, drag)
    results = [result for record in tracks for result in finder.push(record)]
    return [result for result in [*results, *finder.flush()] if isinstance(result, kind)]


def _restitution(rebound):
    return rebound.outgoing.value / rebound.incoming.value


def test_a_known_drag_gives_the_speeds_at_the_contact():
    (rebound,) = _found(Rebound, Measured(DRAG, 0.0))
    assert rebound.drag == DRAG
    at_contact = SPEED * math.exp(-DRAG * AT)
    assert rebound.incoming.value == pytest.approx(at_contact, rel=0.003)
    assert _restitution(rebound) == pytest.approx(RESTITUTION, abs=0.004)


def test_a_rebound_tells_how_often_floor_and_lid_are_hit():
    velocities = np.tile([SPEED, 0.0], (TIMES.size, 1, 1))
    positions = bounced(TIMES, SPEED, RESTITUTION, at=AT)
    finder = ContactFinder(TRAY, Measured(0.0, 0.0))
    for record in tracks_of(positions, velocities=velocities):
        finder.push(record)
    (rebound,) = (result for result in finder.flush() if isinstance(result, Rebound))
    assert rebound.free_height == pytest.approx(TRAY.dimensions[2] - 2e-3)
    assert rebound.temperature == pytest.approx(0.5 * SPEED**2)
    speed = 0.5 * (rebound.incoming.value + rebound.outgoing.value)
    time = rebound.incoming_drag_time + rebound.outgoing_drag_time
    assert rebound.friction_length * speed == pytest.approx(time * rebound.temperature)


def test_a_drag_that_is_known_later_corrects_the_same():
    (rebound,) = _found(Rebound, Measured(0.0, 0.0))
    times = rebound.incoming_drag_time + rebound.outgoing_drag_time
    assert rebound.drag == 0.0
    assert times == pytest.approx(0.5 * TIMES[-1], abs=0.05)
    blind = _restitution(rebound)
    assert blind == pytest.approx(RESTITUTION * math.exp(-DRAG * times), abs=0.004)
    assert _restitution(dragged(rebound, DRAG)) == pytest.approx(RESTITUTION, abs=0.004)


def test_the_flights_on_both_sides_are_bent_by_the_drag():
    before, after = _found(FreeFlight, Measured(0.0, 0.0), jitter=0.0)
    for flight in (before, after):
        bend = float(flight.mean_acceleration @ flight.mean_velocity)
        square = float(flight.mean_velocity @ flight.mean_velocity)
        assert -bend / square == pytest.approx(DRAG, rel=0.03)
        assert flight.relative_drag == pytest.approx(1.0)
    assert before.stamp_ns < round(AT * 1e9) < after.stamp_ns
