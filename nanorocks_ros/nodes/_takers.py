"""Who takes the frames of the camera, and how far they are.

A message that has arrived need not have been taken: a subscription keeps the last few and drops
others without telling whoever sent them. So the nodes of the graph tell by themselves which frame
they are done with, on `camera/taken`, as long as somebody asks.
"""

from __future__ import annotations

import time
from collections import deque

from std_msgs.msg import Header

from nanorocks_ros.nodes._shell import qos_of, stamp_of
from nanorocks_ros.wire import topics

# Fewer than the frames that a subscription to the camera keeps.
_MOST_IN_FLIGHT = 4
_PATIENCE_S = 5.0
_NUDGE_S = 0.2
_LOOK_S = 0.1
_KEPT = 1000


class Takers:
    """Knows the nodes behind the camera, and how many frames they have still to take.

    Parameters
    ----------
    node : NanorocksNode
        That sends the frames.
    """

    def __init__(self, node):
        self._node = node
        self._sent = deque(maxlen=_KEPT)
        self._number = 0
        self._done = {}
        self._heard_of = set()
        self._silent = set()
        self._waiting_since = self._nudged = 0.0
        self._looked = self._counted = -_LOOK_S
        self._count = 0
        self._subscription = None

    def listen(self):
        """Ask the takers to tell how far they are."""
        if self._subscription is None:
            self._subscription = self._node.create_subscription(
                Header, topics.TAKEN.name, self._heard, qos_of(topics.TAKEN)
            )

    def count(self):
        """How many nodes take the camera, or the tray images made from it."""
        now = time.monotonic()
        if now - self._counted >= _LOOK_S:
            self._counted = now
            cameras = (topics.RAW, topics.RAW_COMPRESSED)
            listening = sum(
                self._node.output(camera).get_subscription_count() for camera in cameras
            )
            names = [self._node.resolve_topic_name(camera.name) for camera in cameras]
            direct = {
                _name(info)
                for name in names
                for info in self._node.get_subscriptions_info_by_topic(name)
            }
            self._count = listening + len(self._names() - direct)
        return self._count

    def sent(self, stamp_ns):
        """Note a frame that was sent."""
        self._number += 1
        self._sent.append((stamp_ns, self._number))

    def ready(self):
        """Whether the slowest is close enough behind for another frame."""
        now = time.monotonic()
        self._look(now)
        slow = {
            name
            for name, done in self._done.items()
            if self._number - done >= _MOST_IN_FLIGHT and name not in self._silent
        }
        if not slow:
            self._waiting_since = self._nudged = now
            return True
        if now - self._waiting_since > _PATIENCE_S:
            self._silent |= slow
            self._node.get_logger().warning(
                f'{" and ".join(sorted(slow))}: took no frame for {_PATIENCE_S:g} s; not waited '
                'for until the next that is taken'
            )
        elif not slow & self._heard_of and now - self._nudged > _NUDGE_S:
            # It may have taken all, and not yet known that somebody wants to hear of it.
            self._nudged = now
            return True
        return False

    def _look(self, now):
        if now - self._looked < _LOOK_S:
            return
        self._looked = now
        names = self._names()
        # Whoever is new has missed what was sent before.
        self._done = {name: self._done.get(name, self._number) for name in names}
        self._heard_of &= names
        self._silent &= names

    def _names(self):
        name = self._node.resolve_topic_name(topics.TAKEN.name)
        infos = self._node.get_publishers_info_by_topic(name)
        return {_name(info) for info in infos} - {self._node.get_fully_qualified_name()}

    def _heard(self, message):
        stamp_ns = stamp_of(message.stamp)
        number = next((k for stamp, k in reversed(self._sent) if stamp == stamp_ns), None)
        if number is not None:
            self._done[message.frame_id] = number
            self._heard_of.add(message.frame_id)
            self._silent.discard(message.frame_id)
            self._waiting_since = time.monotonic()


def _name(info):
    return f'{info.node_namespace.rstrip("/")}/{info.node_name}'
