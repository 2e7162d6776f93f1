"""Publishes images of the tracks of a tray, while somebody subscribes.

Tested by ``test/nodes/test_pipeline.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.nodes.base.communication.ros_messages import image_message
from nanorocks_ros.studies.inspection.track_overlay import overlay
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from nanorocks_ros.nodes.base.node import NanorocksNode
    from nanorocks_ros.records import Tracks, TrayImage

# Frames whose tracks are kept to draw paths.
_MAX_FRAMES = 90
# Drawing takes as long as tracking, and 10 images a second are enough: [ns] between two.
_PAUSE_NS = 90_000_000


class TrackImages:
    """Draws tracks over the image that they end in.

    Parameters
    ----------
    node : NanorocksNode
    pixels_per_metre : float, [px/m]
        Of the tray images.
    """

    def __init__(self, node: NanorocksNode, pixels_per_metre: float) -> None:
        self._node = node
        self._scale = pixels_per_metre
        self._tracks: dict[int, deque[Tracks]] = {}
        self._drawn_ns: dict[int, int] = {}

    def has_subscribers(self, tray: int) -> bool:
        """Whether anybody subscribes to the tracks of a tray."""
        return self._node.outputs.has_subscribers(topics.TRACKS, tray)

    def publish(self, image: TrayImage, tracks: Tracks, *, visible: bool = True) -> None:
        """Keep the tracks, and publish them over their image when one is due and `visible`."""
        recent = self._tracks.setdefault(tracks.tray, deque(maxlen=_MAX_FRAMES))
        if recent and tracks.stamp_ns <= recent[-1].stamp_ns:
            recent.clear()
            self._drawn_ns.clear()
        recent.append(tracks)
        last_ns = self._drawn_ns.get(tracks.tray)
        due = last_ns is None or tracks.stamp_ns - last_ns >= _PAUSE_NS
        if due and visible and self.has_subscribers(tracks.tray):
            self._drawn_ns[tracks.tray] = tracks.stamp_ns
            pixels = overlay(image, tuple(recent), self._scale)
            message = image_message(tracks.stamp_ns, f'tray_{tracks.tray}', pixels)
            self._node.outputs.send(topics.TRACKS, message, tracks.tray)
