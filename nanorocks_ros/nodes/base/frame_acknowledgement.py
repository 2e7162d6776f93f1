"""Tells on ``camera/taken`` which frame a node has processed.

Tested by ``test/nodes/workers/test_graph_recorder.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from std_msgs.msg import Header

from nanorocks_ros.nodes.base.communication.ros_messages import time_message
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rclpy.subscription import Subscription

    from nanorocks_ros.nodes.base.node import NanorocksNode

_CHECK_S = 0.1


class FrameAcknowledgement:
    """Acknowledges frames to the player that sends them.

    The topic is offered once all inputs have a publisher: from then on a player can rely on
    this node.

    Parameters
    ----------
    node : NanorocksNode
    inputs : sequence of rclpy.subscription.Subscription
        That the frames come from.
    """

    def __init__(self, node: NanorocksNode, inputs: Sequence[Subscription]) -> None:
        self._node = node
        self._inputs = inputs
        self._timer = node.create_timer(_CHECK_S, self._offer, clock=node.steady_clock)

    def _offer(self) -> None:
        if all(subscription.get_publisher_count() for subscription in self._inputs):
            self._timer.cancel()
            self._node.outputs.offer((topics.TAKEN,))

    def acknowledge(self, stamp_ns: int) -> None:
        """Tell a waiting player that this node has processed a frame."""
        outputs = self._node.outputs
        if outputs.is_offered(topics.TAKEN) and outputs.has_subscribers(topics.TAKEN):
            message = Header(
                stamp=time_message(stamp_ns), frame_id=self._node.get_fully_qualified_name()
            )
            outputs.send(topics.TAKEN, message)
