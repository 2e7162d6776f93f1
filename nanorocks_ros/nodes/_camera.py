"""The camera topic, raw or compressed, as frames."""

from __future__ import annotations

from nanorocks_ros.recordings.images import frame_from_compressed, frame_from_image
from nanorocks_ros.wire import topics


class Camera:
    """Subscribes to the camera and hands on each frame.

    Parameters
    ----------
    node : NanorocksNode
    settings : CameraSettings
    take : callable
        Called with each Frame.
    """

    def __init__(self, node, settings, take):
        compressed = settings.transport == 'compressed'
        topic = topics.RAW_COMPRESSED if compressed else topics.RAW
        self._read = frame_from_compressed if compressed else frame_from_image
        self._take = take
        self.topic = node.resolve_topic_name(topic.name)
        node.listen(topic, self._message)

    def _message(self, message):
        self._take(self._read(message, self.topic))
