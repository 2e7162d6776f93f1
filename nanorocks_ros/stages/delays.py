"""How long after its instant a record is known, at the latest: one table for all stages."""

from __future__ import annotations

from nanorocks_ros.records import (
    NS,
    BodyEstimate,
    ClusterEstimate,
    FreeFlight,
    Merge,
    PairCollision,
    Rebound,
    SpeedEstimate,
)

# Two beads must stay together for longer than free beads do by chance. Counts of bodies wait for
# the merges; their delay is the setting `bodies.delay`, whose default this is.
_MERGE_NS = NS
# For records that are on their way between nodes.
_TRANSPORT_NS = NS

KNOWN_AFTER_NS: dict[type, int] = {
    # The flights after a contact must be long enough to measure their velocities: 1.5 s at 30
    # pictures a second.
    Rebound: 2 * NS,
    PairCollision: 2 * NS,
    # After its last position, until the next flight has begun.
    FreeFlight: 2 * NS,
    Merge: _MERGE_NS,
    BodyEstimate: _MERGE_NS,
    # The middle of a window of up to 3 s of tracks. Speeds by the structure function also wait
    # until the appearance of the beads is known.
    SpeedEstimate: 10 * NS,
    # Completed by the bodies and merges of the same instant.
    ClusterEstimate: _MERGE_NS + _TRANSPORT_NS,
}
"""Largest delay of each kind of record, [ns]."""
