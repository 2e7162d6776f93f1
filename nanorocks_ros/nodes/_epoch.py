"""What the times in the arrays count from: told by the source of the frames, or by us."""

from __future__ import annotations

from nanorocks_ros.nodes._shell import stamp_of, time_message
from nanorocks_ros.wire import topics

_PATIENCE_NS = 1_000_000_000


class Epoch:
    """Follows the topic `epoch`, and holds work back until it is known.

    Parameters
    ----------
    node : NanorocksNode
    may_set : bool
        Whether this node sets the epoch when no one else is about to: the first that sees
        the camera does.
    """

    def __init__(self, node, may_set, follow=True):
        self._node = node
        self._may_set = may_set
        self._held = []
        self._held_stamps = []
        self.ns = None
        if follow:
            node.listen(topics.EPOCH, self._heard, required=False)

    def _heard(self, message):
        stamp_ns = stamp_of(message)
        if self.ns is not None and stamp_ns != self.ns:
            self._node.get_logger().info('the source set a new epoch')
        self._known(stamp_ns)

    def _known(self, stamp_ns):
        self.ns = stamp_ns
        held, self._held = self._held, []
        for work, message in held:
            work(message)

    def _others_will(self, stamp_ns):
        """Whether another node offers the epoch, and has not kept us waiting for a second."""
        waited_ns = stamp_ns - self._held_stamps[0] if self._held_stamps else 0
        return self._node.others_offer(topics.EPOCH) and waited_ns < _PATIENCE_NS

    def when_known(self, stamp_ns, work, message):
        """Do `work(message)` now, or as soon as the epoch is known.

        Parameters
        ----------
        stamp_ns : int or None
            Of the message: the epoch, if it falls to this node to set it. None where the message
            has no stamp that could be one; such a node never sets it.
        """
        if self.ns is None and self._may_set and not self._others_will(stamp_ns):
            self.set(self._held_stamps[0] if self._held_stamps else stamp_ns)
        if self.ns is None:
            # Nothing is lost while discovery takes its time; some seconds of frames at most.
            self._held = [*self._held[-59:], (work, message)]
            if stamp_ns is not None:
                self._held_stamps.append(stamp_ns)
        else:
            work(message)

    def set(self, stamp_ns):
        """Tell everybody the epoch."""
        self._node.send(topics.EPOCH, time_message(stamp_ns))
        self._known(stamp_ns)
