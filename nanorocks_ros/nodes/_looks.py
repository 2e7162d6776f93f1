"""Subscriptions of which a few messages a second will do: pictures, while somebody looks."""

from __future__ import annotations

import time
from functools import partial

from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from nanorocks_ros.dashboard.tray_pictures import encoded
from nanorocks_ros.nodes._crops import gray_frame, picture_frame
from nanorocks_ros.nodes._shell import message_class
from nanorocks_ros.wire import topics

_TOPICS = {'tray': topics.RECTIFIED, 'tracks': topics.TRACKS, 'motion': topics.MOTION}
# A gray camera has no coloured crops.
_GRAY_AFTER_S = 2.0
_OLDEST_S = 60.0
_LAST_ONLY = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.RELIABLE
)


class Looks:
    """Follows what is looked at, and hands on pictures at a limited rate.

    Parameters
    ----------
    node : NanorocksNode
    show : callable
        Takes what is looked at and the picture as a browser takes it.
    pause_s : float, [s]
        Between two pictures.
    """

    def __init__(self, node, show, pause_s):
        self._node, self._show, self._pause_s = node, show, pause_s
        self._open = {}
        self._seen = {}

    def follow(self, wanted):
        """Subscribe to what is wanted, and to nothing else."""
        for look in self._open.keys() - wanted:
            for subscription in self._open.pop(look):
                self._node.destroy_subscription(subscription)
        for look in wanted - self._open.keys():
            self._seen[look] = time.monotonic()
            self._open[look] = [self._subscribe(look, _TOPICS[look[1]])]
        for look, subscriptions in self._open.items():
            missing = time.monotonic() - self._seen[look] > _GRAY_AFTER_S
            if look[1] == 'tray' and missing and len(subscriptions) == 1:
                subscriptions.append(self._subscribe(look, topics.GRAY))

    def _subscribe(self, look, topic):
        take = partial(self._take, look, self._node.resolve_topic_name(topic.of(look[0])))
        return self.sample(topic, look[0], take, self._pause_s)

    def _take(self, look, where, message):
        self._seen[look] = time.monotonic()
        # What moves is a mask, and a mask has no colours.
        frame = (gray_frame if look[1] == 'motion' else picture_frame)(message, where)
        self._show(look, encoded(look[1], frame.image))
        age_s = 1e-9 * (self._node.get_clock().now().nanoseconds - frame.stamp_ns)
        # Of a recording of some other day it means nothing.
        if 0.0 <= age_s < _OLDEST_S:
            self._node.state['picture, since the camera took it [ms]'] = f'{1e3 * age_s:.0f}'

    def sample(self, topic, tray, take, pause_s):
        """Subscribe; messages that come too soon after another are not even read."""
        kind = message_class(topic.type)
        due_s = 0.0

        def sampled(content):
            nonlocal due_s
            now = time.monotonic()
            if now >= due_s:
                due_s = now + pause_s
                self._node.timed(take, deserialize_message(content, kind))

        return self._node.create_subscription(kind, topic.of(tray), sampled, _LAST_ONLY, raw=True)
