"""The epoch, which times in arrays count from: received from the source, or set by this node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.nodes.base.communication.ros_messages import stamp_of, time_message
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable

    from builtin_interfaces.msg import Time

    from nanorocks_ros.nodes.base.node import NanorocksNode

_PATIENCE_NS = 1_000_000_000
# Messages that wait for the epoch: some seconds of frames.
_MAX_HELD = 60


class Epoch:
    """Subscribes to the topic `epoch`, and holds messages back until it is known.

    Parameters
    ----------
    node : NanorocksNode
    may_set : bool
        Whether this node sets the epoch when no other node is about to: the first node that
        sees the camera does.
    follow : bool
        Whether to subscribe to the epoch of others.
    """

    def __init__(self, node: NanorocksNode, *, may_set: bool, follow: bool = True) -> None:
        self._node = node
        self._may_set = may_set
        self._held: list[tuple[Callable[[Any], object], Any]] = []
        self._held_stamps: list[int] = []
        self._ns: int | None = None
        if follow:
            node.listen(topics.EPOCH, self._receive, required=False)

    @property
    def is_known(self) -> bool:
        """Whether the epoch was received or set."""
        return self._ns is not None

    @property
    def ns(self) -> int:
        """The epoch, [ns].

        Raises
        ------
        RuntimeError
            When it is not known yet.
        """
        if self._ns is None:
            raise RuntimeError('the epoch is not known yet')
        return self._ns

    def _receive(self, message: Time) -> None:
        stamp_ns = stamp_of(message)
        if self.is_known and stamp_ns != self.ns:
            self._node.get_logger().info('the source set a new epoch')
        self._adopt(stamp_ns)

    def _adopt(self, stamp_ns: int) -> None:
        self._ns = stamp_ns
        held, self._held = self._held, []
        for work, message in held:
            work(message)

    def _others_may_set(self, stamp_ns: int | None) -> bool:
        """Whether another node offers the epoch, and has kept us waiting for less than 1 s."""
        first_ns = self._held_stamps[0] if self._held_stamps else stamp_ns
        waited_ns = 0 if stamp_ns is None or first_ns is None else stamp_ns - first_ns
        return self._node.outputs.is_offered_by_others(topics.EPOCH) and waited_ns < _PATIENCE_NS

    def when_known(
        self, stamp_ns: int | None, work: Callable[[Any], object], message: Any
    ) -> None:
        """Call `work(message)` now, or as soon as the epoch is known.

        Parameters
        ----------
        stamp_ns : int or None, [ns]
            Of the message: the epoch, if this node sets it. None for messages without a stamp
            of the camera; a node that passes None must not set the epoch.
        work : callable
        message : object
        """
        if not self.is_known and self._may_set and not self._others_may_set(stamp_ns):
            first_ns = self._held_stamps[0] if self._held_stamps else stamp_ns
            if first_ns is not None:
                self.set(first_ns)
        if not self.is_known:
            # Discovery takes its time, and no message may be lost meanwhile.
            self._held = [*self._held[1 - _MAX_HELD :], (work, message)]
            if stamp_ns is not None:
                self._held_stamps.append(stamp_ns)
        else:
            work(message)

    def set(self, stamp_ns: int) -> None:
        """Publish the epoch."""
        self._node.outputs.send(topics.EPOCH, time_message(stamp_ns))
        self._adopt(stamp_ns)
