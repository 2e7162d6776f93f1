"""Quality of service of recorded topics: conversion to and from the metadata of a recording.

Tested by ``test/recordings/bag/test_writer.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.yaml_limits import load_yaml

# The infinite duration of ROS 2.
_FOREVER = QosTime(9223372036, 854775807)
# Recordings before version 9 store the numbers of rmw instead of names.
_RELIABLE = (1, 'reliable')
_TRANSIENT_LOCAL = (1, 'transient_local')


@dataclass(frozen=True, slots=True, kw_only=True)
class OfferedQos:
    """Quality of service that a publisher offers.

    Parameters
    ----------
    reliable : bool
        True: reliable; False: best effort.
    transient_local : bool
        True: late subscribers get the last messages; False: volatile.
    depth : int, >= 1
        Queue depth in messages.
    """

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10

    def profile(self) -> Qos:
        """The same as a profile of rosbags, for the metadata of a recording."""
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
    """Parse the quality of service of a topic from the metadata of a recording.

    If several publishers offered the topic, the best value of each policy is returned.

    Parameters
    ----------
    text : str
        The recording's ``offered_qos_profiles``, YAML.

    Returns
    -------
    OfferedQos or None
        None if the text is empty or cannot be parsed.
    """
    try:
        profiles: Any = load_yaml('quality of service', text) or []
        return OfferedQos(
            reliable=any(profile['reliability'] in _RELIABLE for profile in profiles),
            transient_local=any(profile['durability'] in _TRANSIENT_LOCAL for profile in profiles),
            depth=max(max(1, int(profile['depth'])) for profile in profiles),
        )
    except (ConfigurationError, TypeError, KeyError, ValueError, OverflowError):
        return None
