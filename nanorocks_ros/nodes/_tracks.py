"""The picture of the tracks of a tray, for whoever looks."""

from __future__ import annotations

from collections import deque

from nanorocks_ros.nodes._shell import image_message
from nanorocks_ros.studies.inspection.track_overlay import overlay
from nanorocks_ros.wire import topics

# Pictures over which ways are drawn.
_KEPT = 90
# Drawing costs as much as following, and eyes are slow: [ns] between two drawings.
_PAUSE_NS = 90_000_000


class TracksPicture:
    """Draws tracks over the image that they end in.

    Parameters
    ----------
    node : NanorocksNode
    pixels_per_metre : float, [px/m]
    """

    def __init__(self, node, pixels_per_metre):
        self._node = node
        self._scale = pixels_per_metre
        self._tracks = {}
        self._drawn_ns = {}

    def wanted(self, tray):
        """Whether anybody looks at the tracks of a tray."""
        return self._node.wanted(topics.TRACKS, tray)

    def send(self, image, tracks, shown=True):
        """Publish the tracks up to now over their image, if it is to be shown."""
        recent = self._tracks.setdefault(tracks.tray, deque(maxlen=_KEPT))
        if recent and tracks.stamp_ns <= recent[-1].stamp_ns:
            recent.clear()
            self._drawn_ns.clear()
        recent.append(tracks)
        last_ns = self._drawn_ns.get(tracks.tray)
        due = last_ns is None or tracks.stamp_ns - last_ns >= _PAUSE_NS
        if due and shown and self.wanted(tracks.tray):
            self._drawn_ns[tracks.tray] = tracks.stamp_ns
            picture = overlay(image, tuple(recent), self._scale)
            message = image_message(tracks.stamp_ns, f'tray_{tracks.tray}', picture)
            self._node.send(topics.TRACKS, message, tracks.tray)
