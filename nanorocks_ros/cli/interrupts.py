"""Ctrl-C at any moment, also while modules are loaded and functions compiled."""

from __future__ import annotations

import signal
import sys
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from types import FrameType, TracebackType

# After it an interruption that was lost is repeated, [s]: by then the call that lost it is over.
_REPEAT_S = 0.02


class Interrupts:
    """Makes the first interruption end the command, wherever it arrives, and ignores the others.

    An exception in a call from C is printed and lost: LLVM calls Python when it has compiled a
    function, and objects are deleted at any time. Such an interruption is raised once more. Other
    code turns an interruption into an error of its own; `seen` tells.

    Attributes
    ----------
    seen : bool
        Whether the command was interrupted.
    """

    def __init__(self) -> None:
        self.seen = False

    def __enter__(self) -> Interrupts:
        # Elsewhere signals cannot be set; and what runs in the background ignores them.
        self._active = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        )
        if self._active:
            self._hook = sys.unraisablehook
            sys.unraisablehook = self._repeat
            signal.signal(signal.SIGINT, self._raise)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._active:
            ended = signal.SIG_IGN if self.seen else signal.default_int_handler
            signal.signal(signal.SIGINT, ended)
            sys.unraisablehook = self._hook

    def _raise(self, number: int, frame: FrameType | None) -> None:
        self.seen = True
        raise KeyboardInterrupt

    def _repeat(self, lost: Any) -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):
            self._hook(lost)
            return
        # To the thread that waits, so that it wakes up.
        target = threading.main_thread().ident, signal.SIGINT
        timer = threading.Timer(_REPEAT_S, signal.pthread_kill, target)
        timer.daemon = True
        timer.start()
