"""Message types: those of ROS 2 Jazzy, and others that are defined in a recording.

Tested by ``test/recordings/bag/test_writer.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from nanorocks_ros.recordings.messages.type_limits import check_text, check_types

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


def standard_types() -> Typestore:
    """A new store of the message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def register_type(store: Typestore, name: str, definition: str, form: str) -> None:
    """Add a type and its component types, unless the store contains them.

    Parameters
    ----------
    store : Typestore
    name : str
        For example ``my_msgs/msg/Thing``.
    definition : str
        Text of the definition, with those of its component types, as stored in recordings.
    form : str
        ``ros2msg`` or ``ros2idl``.

    Raises
    ------
    rosbags.typesys.TypesysError
        If the text cannot be parsed, or the type exceeds a limit.
    """
    if name in store.fielddefs:
        return
    check_text(definition)
    types = (
        get_types_from_idl(definition)
        if form == 'ros2idl'
        else get_types_from_msg(definition, name)
    )
    check_types({**store.fielddefs, **types})
    store.register({key: value for key, value in types.items() if key not in store.fielddefs})
