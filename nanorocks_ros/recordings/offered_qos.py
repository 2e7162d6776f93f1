"""How the topics of a recording were offered, as it keeps that: written and read again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

# What ROS 2 calls an infinite duration.
_FOREVER = QosTime(9223372036, 854775807)
# Recordings before version 9 keep the numbers of rmw.
_RELIABLE = (1, 'reliable')
_TRANSIENT_LOCAL = (1, 'transient_local')


@dataclass(frozen=True, slots=True, kw_only=True)
class OfferedQos:
    """How a topic was, or would be, offered.

    Parameters
    ----------
    reliable : bool
        Else best effort.
    transient_local : bool
        A late subscriber still gets the last messages; else volatile.
    depth : int, >= 1
        Messages kept.
    """

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10

    def profile(self) -> Qos:
        """The profile that recordings keep and players offer again."""
        durability = QosDurability.TRANSIENT_LOCAL if self.transient_local else None
        return Qos(
            history=QosHistory.KEEP_LAST,
            depth=self.depth,
            reliability=QosReliability.RELIABLE if self.reliable else QosReliability.BEST_EFFORT,
            durability=durability or QosDurability.VOLATILE,
            deadline=_FOREVER,
            lifespan=_FOREVER,
            liveliness=QosLiveliness.AUTOMATIC,
            liveliness_lease_duration=_FOREVER,
            avoid_ros_namespace_conventions=False,
        )


def recorded_qos(text: str) -> OfferedQos | None:
    """How a topic was offered, from what a recording says of it.

    Where several offered it, it is as good as the best of them.

    Parameters
    ----------
    text : str
        The recording's ``offered_qos_profiles``, YAML.

    Returns
    -------
    OfferedQos or None
        None where it says nothing that can be understood.
    """
    try:
        profiles: Any = yaml.safe_load(text) or []
        return OfferedQos(
            reliable=any(profile['reliability'] in _RELIABLE for profile in profiles),
            transient_local=any(profile['durability'] in _TRANSIENT_LOCAL for profile in profiles),
            depth=max(max(1, int(profile['depth'])) for profile in profiles),
        )
    except (yaml.YAMLError, TypeError, KeyError, ValueError, RecursionError):
        return None
