"""Callbacks that need no more than a look once in a while."""

from __future__ import annotations

import time

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

_OPEN_S = 0.05


class NowAndThen(MutuallyExclusiveCallbackGroup):
    """A group whose members are waited for only for a moment after each `open`.

    rclpy puts everything that a node may wait for into a new set before each wait, and every
    publisher brings an event of its own: with the 60 publishers of eight trays that took 2 ms a
    wait, three times a frame, to learn that nobody subscribed with a wrong quality of service.
    An event that has come meanwhile is kept by the middleware.
    """

    def __init__(self):
        super().__init__()
        self._until = 0.0

    def open(self):
        """Let the members be waited for, for a moment."""
        self._until = time.monotonic() + _OPEN_S

    def can_execute(self, entity):
        """Whether a member may run now."""
        return time.monotonic() < self._until and super().can_execute(entity)
