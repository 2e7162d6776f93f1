"""The table of delays against the settings and the stages."""

from __future__ import annotations

from nanorocks_ros.records import (
    BodyEstimate,
    ClusterEstimate,
    Merge,
    PairCollision,
    Rebound,
)
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.delays import KNOWN_AFTER_NS

NS = 1_000_000_000


def test_bodies_are_known_after_the_default_delay_of_the_settings():
    assert KNOWN_AFTER_NS[BodyEstimate] == round(PipelineSettings().bodies.delay * NS)


def test_clusters_wait_for_bodies_and_merges():
    assert KNOWN_AFTER_NS[ClusterEstimate] > KNOWN_AFTER_NS[BodyEstimate]
    assert KNOWN_AFTER_NS[ClusterEstimate] > KNOWN_AFTER_NS[Merge]


def test_both_kinds_of_contacts_are_known_at_the_same_time():
    # They are counted together.
    assert KNOWN_AFTER_NS[Rebound] == KNOWN_AFTER_NS[PairCollision]
