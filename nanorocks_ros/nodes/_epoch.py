"""What the times in the arrays count from: told by the source of the frames, or by us."""

from __future__ import annotations

from nanorocks_ros.nodes._shell import stamp_of, time_message
from nanorocks_ros.wire import topics


class Epoch:
    """Follows the topic `epoch`, and holds work back until it is known.

    Parameters
    ----------
    node : NanorocksNode
    may_set : bool
        Whether this node sets the epoch when no one else is about to: the first that sees
        the camera does.
    """

    def __init__(self, node, may_set):
        self._node = node
        self._may_set = may_set
        self._held = []
        self.ns = None
        node.listen(topics.EPOCH, self._heard, required=False)

    def _heard(self, message):
        stamp_ns = stamp_of(message)
        if self.ns is not None and stamp_ns != self.ns:
            self._node.get_logger().info('the source set a new epoch')
        self.ns = stamp_ns
        held, self._held = self._held, []
        for work, message in held:
            work(message)

    def when_known(self, stamp_ns, work, message):
        """Do `work(message)` now, or as soon as the epoch is known.

        Parameters
        ----------
        stamp_ns : int
            Of the message: the epoch, if it falls to this node to set it.
        """
        if self.ns is None and self._may_set and not self._node.others_offer(topics.EPOCH):
            self.set(stamp_ns)
        if self.ns is None:
            # Nothing is lost while discovery takes its time; 10 s of frames at most.
            self._held = [*self._held[-299:], (work, message)]
        else:
            work(message)

    def set(self, stamp_ns):
        """Tell everybody the epoch."""
        self.ns = stamp_ns
        self._node.send(topics.EPOCH, time_message(stamp_ns))
