"""Records as typed messages, where the package `nanorocks_msgs` is installed.

Tested by ``test/nodes/test_typed_messages.py``.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from std_msgs.msg import Header

from nanorocks_ros.nodes.base.communication.ros_messages import message_class, time_message
from nanorocks_ros.wire.array_layouts import enumerated, field_value, layout
from nanorocks_ros.wire.products import TYPED_TOPICS

if TYPE_CHECKING:
    from nanorocks_ros.records import ArrayRecord

_BUILD = (
    'build it from the clone, with ROS 2 Jazzy sourced: `colcon build --base-paths . msg_defs && '
    '. install/setup.sh`'
)


@cache
def typed_problem() -> str:
    """Why there are no typed messages, with the remedy; empty where there are."""
    for record_type, topic in TYPED_TOPICS.items():
        try:
            types = message_class(topic.type).get_fields_and_field_types()
        except ImportError as error:
            missing = error.name or 'nanorocks_msgs'
            return f'{missing}: is not installed, so that results go out as arrays alone; {_BUILD}'
        except AttributeError:
            types = {}
        fields = {field.name for field in layout(record_type).fields}
        if not fields <= set(types):
            return f'nanorocks_msgs: {topic.type} is of another release; {_BUILD}'
    return ''


def typed_message(record: ArrayRecord, epoch_ns: int) -> Any:
    """A record as the message of its own type.

    Parameters
    ----------
    record : any of ArrayRecord
    epoch_ns : int, [ns]
        What `time` counts from; the header has the stamp itself.
    """
    message = message_class(TYPED_TOPICS[type(record)].type)()
    message.header = Header(stamp=time_message(record.stamp_ns), frame_id=f'tray_{record.tray}')
    for field in layout(type(record)).fields:
        value = field_value(record, field, epoch_ns)
        setattr(message, field.name, field.python_type(value))
    for name, words in enumerated(record).items():
        setattr(message, name, words)
    return message
