"""Connections of a rosbag2 writer: topic, type, message definition and quality of service.

Tested by ``test/recordings/bag/test_writer.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbags.typesys import TypesysError

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.messages.message_types import register_type

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag2 import Writer
    from rosbags.typesys.store import Typestore

    from nanorocks_ros.recordings.bag.offered_topics import OfferedTopic

# Type hash of a type whose definition cannot be parsed.
_UNKNOWN_DIGEST = f'RIHS01_{"0" * 64}'


def add_connection(
    writer: Writer, store: Typestore, topic: str, offered: OfferedTopic
) -> Connection:
    """Add a topic to a rosbag2 writer.

    Parameters
    ----------
    writer : Writer
    store : Typestore
        The definition of the topic is added to it.
    topic : str
        Absolute name.
    offered : OfferedTopic

    Returns
    -------
    Connection

    Raises
    ------
    RecordingError
        If the type is not part of ROS 2 Jazzy and its definition is missing or cannot be parsed.
    """
    if offered.verbatim:
        return _add_verbatim(writer, store, topic, offered)
    try:
        if offered.definition:
            register_type(store, offered.msgtype, offered.definition, offered.definition_format)
        return writer.add_connection(
            topic,
            offered.msgtype,
            typestore=store,
            offered_qos_profiles=[offered.qos.profile()],
        )
    except (TypesysError, LookupError, ValueError) as error:
        raise RecordingError(
            f'{writer.path}: {topic}',
            f"type '{offered.msgtype}' is not part of ROS 2 Jazzy and has no usable definition",
            'give its definition',
        ) from error


def _add_verbatim(
    writer: Writer, store: Typestore, topic: str, offered: OfferedTopic
) -> Connection:
    """Keep the recorded definition; look it up only if it is missing."""
    definition, digest = offered.definition, _UNKNOWN_DIGEST
    if offered.msgtype in store.fielddefs:
        digest = store.hash_rihs01(offered.msgtype)
        definition = definition or store.generate_msgdef(offered.msgtype, ros_version=2)[0]
    return writer.add_connection(
        topic,
        offered.msgtype,
        msgdef=definition,
        rihs01=digest,
        serialization_format=offered.encoding,
        offered_qos_profiles=[offered.qos.profile()],
    )
