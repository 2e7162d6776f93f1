"""Progress bars of the commands, shown on a terminal only.

Tested by ``test/cli/simulation/test_sweep.py``.
"""

from __future__ import annotations

import sys
from typing import Any


class Progress:
    """A bar with the time left, on a terminal, for work of more than a second."""

    def __init__(self, label: str) -> None:
        self._label = label

    def __enter__(self) -> Progress:
        from tqdm import tqdm

        self._bar = tqdm(
            total=1.0,
            desc=self._label,
            delay=1.0,
            leave=False,
            disable=None,
            bar_format='{desc}: {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left',
        )
        return self

    def part(self, done: float) -> None:
        """Show the part that is done, 0 to 1."""
        self._bar.update(done - self._bar.n)

    def count(self, done: int, total: int) -> None:
        """Show the number of steps that are done."""
        self.part(done / total)

    def __exit__(self, *_: object) -> None:
        self._bar.close()


class RunProgress:
    """A bar with runs done, their rate and the time left, on a terminal."""

    def __init__(self, label: str = '') -> None:
        self._label = label

    def __enter__(self) -> RunProgress:
        self._bar: Any = None
        return self

    def update(self, done: int, total: int) -> None:
        """Show the number of runs that are done."""
        from tqdm import tqdm

        if self._bar is None:
            # Mean rate since the start: tasks finish in bursts.
            self._bar = tqdm(
                desc=self._label or None,
                total=total,
                initial=done,
                unit='run',
                leave=False,
                disable=None,
                smoothing=0.0,
            )
        self._bar.update(done - self._bar.n)

    def notice(self, text: str) -> None:
        """Print one message for the user."""
        print(f'nanorocks: {text}', file=sys.stderr)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
