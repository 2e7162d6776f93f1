"""Blocks that an interruption waits for, so that nothing is half written.

Tested by ``test/recordings/bag/test_uninterrupted.py``.
"""

from __future__ import annotations

import signal
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl-C wait until the end of the block.

    Interruptions arrive in the main thread alone; in others, and where no Python function takes
    them, the block runs as it is. Blocks may be nested: the outermost ends the wait.

    Raises
    ------
    KeyboardInterrupt
        After the block, or whatever else the handler of the signal raises.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    waiting: list[tuple[int, FrameType | None]] = []

    def wait(number: int, frame: FrameType | None) -> None:
        waiting.append((number, frame))

    signal.signal(signal.SIGINT, wait)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if waiting:
            handler(*waiting[0])
