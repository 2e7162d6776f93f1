"""Cycles of a tray that are over, kept so that a browser can open them again.

Tested by ``test/dashboard/test_past_cycles.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from nanorocks_ros.dashboard.curves import Row

# Points that are kept of each curve: more than a plot has columns of pixels.
MOST_KEPT_POINTS = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class PastCycle:
    """A cycle that is over.

    Parameters
    ----------
    cycle : int
    start : float or None, [s]
        The shaking event that opened it.
    latest : dict
        Its last results, as `TrayBoard.latest`.
    rows : dict of str to list of rows
        Points of each curve.
    """

    cycle: int
    start: float | None
    latest: dict[str, dict[str, Any]]
    rows: dict[str, list[Row]]


class PastCycles:
    """The last cycles of one tray, as many as fit.

    Parameters
    ----------
    most : int
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._cycles: dict[int, PastCycle] = {}

    @property
    def numbers(self) -> list[int]:
        """The cycles that can be opened, in order."""
        return sorted(self._cycles)

    def get(self, cycle: int) -> PastCycle | None:
        """A cycle, or None where it is not kept."""
        return self._cycles.get(cycle)

    def keep(
        self,
        cycle: int,
        start: float | None,
        latest: Mapping[str, dict[str, Any]],
        rows: Mapping[str, list[Row]],
    ) -> None:
        """Keep a cycle with thinned curves, and forget the oldest above the limit."""
        thinned = {name: _thinned(points) for name, points in rows.items()}
        self._cycles[cycle] = PastCycle(
            cycle=cycle, start=start, latest=dict(latest), rows=thinned
        )
        while len(self._cycles) > self._most:
            del self._cycles[min(self._cycles)]

    def amend(self, cycle: int, name: str, latest: dict[str, Any], row: Row) -> None:
        """Add a result that came after the next cycle had begun; the curve stays in order."""
        past = self._cycles.get(cycle)
        if past is None:
            return
        past.latest[name] = latest
        time = row[0]
        before = [
            point
            for point in past.rows[name]
            if point[0] is not None and time is not None and point[0] < time
        ]
        past.rows[name] = [*before, row]

    def forget(self) -> None:
        """Forget all: the source started again."""
        self._cycles.clear()


def _thinned(rows: list[Row]) -> list[Row]:
    step = -(-len(rows) // MOST_KEPT_POINTS) if rows else 1
    return rows[:-1:step] + rows[-1:] if step > 1 else list(rows)
