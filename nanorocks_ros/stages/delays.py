"""How long after its instant a record is known, at the latest: one table for all stages."""

from __future__ import annotations

from nanorocks_ros.records import (
    BodyEstimate,
    ClusterEstimate,
    Merge,
    PairCollision,
    Rebound,
    SpeedEstimate,
)

_NS = 1_000_000_000

KNOWN_AFTER_NS: dict[type, int] = {
    # The flights after a contact must be long enough to tell their velocities: 1.5 s at 30
    # pictures a second.
    Rebound: 2 * _NS,
    PairCollision: 2 * _NS,
    # Two beads must stay together for longer than free beads do by chance.
    Merge: _NS,
    # By the default of the setting `bodies.delay`, which the counts follow.
    BodyEstimate: _NS,
    # The middle of a window of up to 3 s of tracks. Those of the structure function wait until
    # the appearance of the beads is known.
    SpeedEstimate: 10 * _NS,
    # They hold bodies and merges of the same instant; a second more is for messages on their way.
    ClusterEstimate: 2 * _NS,
}
"""Largest delay of each kind of record, [ns]."""
