"""A callback group whose callbacks run only once in a while, to keep the executor fast."""

from __future__ import annotations

import time
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

_OPEN_S = 0.05


class ThrottledCallbacks(MutuallyExclusiveCallbackGroup):
    """A group that the executor waits for only for a moment after each `open`.

    Before each wait rclpy puts everything that a node may wait for into a new set, and every
    publisher brings an event of its own. With the 60 publishers of eight trays that took 2 ms a
    wait, three times a frame, only to learn that no subscription had an incompatible QoS. The
    middleware keeps an event that comes while the group is closed.
    """

    def __init__(self) -> None:
        super().__init__()
        self._closes_at = 0.0

    def open(self) -> None:
        """Let the callbacks of the group run, for 50 ms."""
        self._closes_at = time.monotonic() + _OPEN_S

    def can_execute(self, entity: Any) -> bool:
        """Whether a callback of the group may run now."""
        return time.monotonic() < self._closes_at and super().can_execute(entity)
