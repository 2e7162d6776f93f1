"""The type of callbacks that report progress; there is nothing to test."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the steps done and the number of steps."""
