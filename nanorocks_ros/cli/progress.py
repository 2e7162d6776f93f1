"""How far a command has come, for people at a terminal."""

from __future__ import annotations

import sys
from typing import Any


class Progress:
    """How much is done and the time left, on a terminal and when it takes more than a second."""

    def __init__(self, what: str) -> None:
        self._what = what

    def __enter__(self) -> Progress:
        from tqdm import tqdm

        self._bar = tqdm(
            total=1.0,
            desc=self._what,
            delay=1.0,
            leave=False,
            disable=None,
            bar_format='{desc}: {percentage:3.0f} %|{bar}| {elapsed}, {remaining} left',
        )
        return self

    def part(self, done: float) -> None:
        """So much of 1 is done."""
        self._bar.update(done - self._bar.n)

    def count(self, done: int, total: int) -> None:
        """So many of all are done."""
        self.part(done / total)

    def __exit__(self, *_: object) -> None:
        self._bar.close()


class RunProgress:
    """Runs done, their rate and the time left on a terminal; silence elsewhere."""

    def __init__(self, what: str = '') -> None:
        self._what = what

    def __enter__(self) -> RunProgress:
        self._bar: Any = None
        return self

    def update(self, done: int, total: int) -> None:
        """So many runs of all are done."""
        from tqdm import tqdm

        if self._bar is None:
            # Evenly weighed: tasks come in bursts.
            self._bar = tqdm(
                desc=self._what or None,
                total=total,
                initial=done,
                unit='run',
                leave=False,
                disable=None,
                smoothing=0.0,
            )
        self._bar.update(done - self._bar.n)

    def notice(self, text: str) -> None:
        """One line of what the user should know."""
        print(f'nanorocks: {text}', file=sys.stderr)

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
