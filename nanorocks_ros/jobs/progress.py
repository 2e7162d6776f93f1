"""The type of callbacks that report progress; there is nothing to test.

Tested by ``test/jobs/test_resumed_tasks.py``.
"""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the steps done and the number of steps."""
