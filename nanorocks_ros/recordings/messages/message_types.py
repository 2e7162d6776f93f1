"""Message definitions: those of ROS 2 Jazzy, and others that a recording brings along."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


def standard_types() -> Typestore:
    """A new store of the message types of ROS 2 Jazzy."""
    return get_typestore(Stores.ROS2_JAZZY)


def register(store: Typestore, name: str, definition: str, form: str) -> None:
    """Add a type, and what it is made of, unless the store knows them.

    Parameters
    ----------
    store : Typestore
    name : str
        For example ``my_msgs/msg/Thing``.
    definition : str
        Text, with the definitions of the types it is made of, as recordings keep it.
    form : str
        ``ros2msg`` or ``ros2idl``.

    Raises
    ------
    rosbags.typesys.TypesysError
        When the text cannot be understood.
    """
    if name in store.fielddefs:
        return
    types = (
        get_types_from_idl(definition)
        if form == 'ros2idl'
        else get_types_from_msg(definition, name)
    )
    store.register({key: value for key, value in types.items() if key not in store.fielddefs})
