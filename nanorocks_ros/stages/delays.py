"""How long after its instant a record is known, at the latest: one table for all stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from nanorocks_ros.settings import PipelineSettings

if TYPE_CHECKING:
    from nanorocks_ros.settings import BodySettings

# For records that are on their way between nodes.
_TRANSPORT_NS = NS


def merges_after_ns(settings: BodySettings) -> int:
    """How long counts of bodies wait for merges, [ns].

    Two beads must stay together for longer than free beads do by chance.
    """
    return round(settings.delay * NS)


def clusters_after_ns(settings: BodySettings) -> int:
    """When the bodies and merges of an instant are known that complete its clusters, [ns]."""
    return merges_after_ns(settings) + _TRANSPORT_NS


_BODIES = PipelineSettings().bodies

KNOWN_AFTER_NS: dict[type, int] = {
    # The flights after a contact must be long enough to measure their velocities: 1.5 s at 30
    # pictures a second.
    Rebound: 2 * NS,
    PairCollision: 2 * NS,
    # After its last position, until the next flight has begun.
    FreeFlight: 2 * NS,
    Merge: merges_after_ns(_BODIES),
    BodyEstimate: merges_after_ns(_BODIES),
    # The middle of a window of up to 3 s of tracks. Speeds by the structure function also wait
    # until the appearance of the beads is known.
    SpeedEstimate: 10 * NS,
    ClusterEstimate: clusters_after_ns(_BODIES),
}
"""Largest delay of each kind of record, [ns]; with the default setting `bodies.delay`."""
