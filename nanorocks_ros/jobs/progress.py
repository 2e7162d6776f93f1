"""Progress of long work, as callbacks report it."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the steps done and the number of steps."""
