"""Tells how the compilation of a first start gets on: in the log, diagnostics and the live page.

Tested by ``test/nodes/base/test_compile_progress.py``.
"""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from numba.core import event

if TYPE_CHECKING:
    from collections.abc import Callable

_REPEAT_S = 1.0
# The live page shows texts that begin so as its state (dashboard/page/words.js).
COMPILING = 'compiling functions, once on this machine'


class CompileProgress(event.Listener):
    """Counts what is compiled, as opposed to loaded, and tells it about once a second.

    Parameters
    ----------
    tell : callable
        Called with a text, in the thread that made this object, which is inside of a call.
    """

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._thread = threading.get_ident()
        self._told_at = -_REPEAT_S
        self.count = 0
        event.register('numba:compile', self)

    def on_start(self, event: event.Event) -> None:
        """Note a function; those that it calls follow."""
        self.count += 1
        now = time.monotonic()
        # ROS is called in one thread only.
        if threading.get_ident() != self._thread or now - self._told_at < _REPEAT_S:
            return
        self._told_at = now
        name = event.data['dispatcher'].py_func.__name__
        self._tell(f'{COMPILING}: {name}, {self.count} so far')

    def on_end(self, event: event.Event) -> None:
        """See `on_start`."""

    def close(self) -> None:
        """Count and tell no longer."""
        event.unregister('numba:compile', self)
