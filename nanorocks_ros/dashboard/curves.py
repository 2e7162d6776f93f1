"""A curve of the live page: its points, thinned where there are too many.

Tested by ``test/dashboard/test_board.py``.
"""

from __future__ import annotations

Row = list[float | None]
"""A point of a curve: time [s], then its values."""

# Points of a curve; at ten a second the longest cycle of the flight has 600.
MOST_POINTS = 4096


class Series:
    """Points of a curve in order of time; halved in number when there are too many."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.generation = 0

    def append(self, row: Row) -> None:
        """Add a point."""
        self.rows.append(row)
        if len(self.rows) > MOST_POINTS:
            self.rows = self.rows[:-1:2] + self.rows[-1:]
            self.generation += 1

    def cut(self, time: float) -> None:
        """Remove the points later than a time, [s]."""
        kept = [row for row in self.rows if row[0] is None or row[0] <= time]
        if len(kept) < len(self.rows):
            self.rows = kept
            self.generation += 1

    def drop_before(self, time: float) -> None:
        """Remove the points earlier than a time, [s]."""
        self.rows = [row for row in self.rows if row[0] is not None and row[0] >= time]
        self.generation += 1

    def since(self, end: tuple[int, int]) -> tuple[int, list[Row]]:
        """Index of the first new point, and the new points."""
        generation, count = end
        first = count if generation == self.generation else 0
        return first, self.rows[first:]

    @property
    def end(self) -> tuple[int, int]:
        """The position of a client that has all points."""
        return self.generation, len(self.rows)
