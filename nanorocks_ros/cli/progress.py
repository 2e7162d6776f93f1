"""How far a command has come, for people at a terminal."""

from __future__ import annotations


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
