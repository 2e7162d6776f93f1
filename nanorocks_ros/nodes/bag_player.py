"""Node: a recorded run, published again at the pace it was recorded, with ``/clock``."""

from __future__ import annotations

from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

from nanorocks_ros.experiment.settings import BagSettings, PacingSettings
from nanorocks_ros.nodes._node import NanorocksNode
from nanorocks_ros.nodes._pacing import Pacer
from nanorocks_ros.nodes._shell import image_message, time_message
from nanorocks_ros.nodes._sources import opened_bag
from nanorocks_ros.recordings.images import frame_from_compressed
from nanorocks_ros.wire import topics

_KNOWN = {one.name.format(tray=k): (one, k) for one in topics.TOPICS for k in range(1, 9)}


class BagPlayerNode(NanorocksNode):
    """Plays a bag; topics under ``/nanorocks`` move with the node's own namespace."""

    def __init__(self):
        super().__init__('bag_player')
        settings = self.declare(BagSettings())
        self._bag = opened_bag(settings)
        for notice in self._bag.reader.notices:
            self.get_logger().warning(notice)
        self._loop = settings.loop
        self._last = None
        self._clock_output = self.create_publisher(Clock, '/clock', QoSProfile(depth=10))
        epoch_ns = self._bag.epoch_ns()
        self.send(topics.EPOCH, time_message(epoch_ns))
        self._pacer = Pacer(
            self, self._moments(), self._emit, self.declare(PacingSettings()), self.finish
        )

    def _moments(self):
        reader = self._bag.reader
        known = {name: _KNOWN[self._relative(name)] for name in reader.topics if self._knows(name)}
        known.pop(topics.EPOCH.absolute(), None)
        while True:
            for message in reader.messages(list(known)):
                yield message.log_time_ns, (message, *known[message.topic])
            if not self._loop:
                return

    @staticmethod
    def _relative(name):
        return name.removeprefix(f'{topics.NAMESPACE}/')

    def _knows(self, name):
        known = self._relative(name) in _KNOWN
        if not known:
            self.get_logger().warning(f'{name}: not a topic of the graph; it is not played')
        return known

    def _emit(self, stamp_ns, moment):
        message, topic, tray = moment
        self._clock_output.publish(Clock(clock=time_message(stamp_ns)))
        self.send(topic, message.cdr, tray)
        if topic is topics.RAW_COMPRESSED and self.wanted(topics.RAW):
            self.timed(self._decoded, message)

    def _decoded(self, message):
        content = self._bag.reader.deserialize(message)
        frame = frame_from_compressed(content, message.topic)
        image = image_message(frame.stamp_ns, 'camera', frame.image)
        self.send(topics.RAW, image)
        # Let go only when there is the next one, see _camera.py.
        self._last = frame, image
