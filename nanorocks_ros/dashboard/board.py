"""The contents of the page: current cycle and latest results of each tray, and all nodes.

Nothing here waits for a client. A `Cursor` per client records what was sent; `Board.news` returns
the difference to now. A slow client misses intermediate steps, a new one gets the whole cycle.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.dashboard.past_cycles import PastCycles
from nanorocks_ros.dashboard.tray_board import TrayBoard
from nanorocks_ros.settings import DashboardSettings
from nanorocks_ros.wire.products import CURVES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from nanorocks_ros.dashboard.past_cycles import PastCycle
    from nanorocks_ros.dashboard.tray_board import Cursor
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import ArrayRecord

# Limits of nodes and of values per node.
_MOST_NODES, _MOST_VALUES = 64, 48
_LONGEST_NAME, _LONGEST_TEXT = 80, 300
_FORGOTTEN_S = 60.0
_LEVELS = {0: 'ok', 1: 'warning', 2: 'error', 3: 'silent'}


class Board:
    """Every tray and every node.

    Parameters
    ----------
    trays : mapping of int to Tray
        For their descriptions; other trays are shown without.
    kept_cycles : int
        Past cycles of each tray that can be opened.
    """

    def __init__(
        self, trays: Mapping[int, Tray], kept_cycles: int = DashboardSettings().kept_cycles
    ) -> None:
        self._known = trays
        self._kept_cycles = kept_cycles
        self._trays: dict[int, TrayBoard] = {}
        self._nodes: dict[str, dict[str, Any]] = {}
        self._nodes_version = 0

    def take(self, record: ArrayRecord, now_s: float) -> None:
        """Note a result.

        Parameters
        ----------
        record : any of `wire.products.CURVES`
        now_s : float, [s]
            Of a clock that never goes back.
        """
        self.expect(record.tray, now_s)
        self._trays[record.tray].take(record, now_s)

    def expect(self, number: int, now_s: float) -> None:
        """Show a tray that has no results yet."""
        if number not in self._trays:
            self._trays[number] = TrayBoard(
                describe(self._known.get(number)),
                heard_s=now_s,
                past=PastCycles(self._kept_cycles),
            )

    def past_cycle(self, number: int, cycle: int) -> PastCycle | None:
        """A cycle of a tray that is over, or None where it is not kept."""
        tray = self._trays.get(number)
        return None if tray is None else tray.past.get(cycle)

    def diagnose(
        self,
        statuses: Iterable[tuple[str, int, str, Sequence[tuple[str, str]]]],
        now_s: float,
    ) -> None:
        """Note the diagnostics of nodes: name, level, text, and pairs of names and values."""
        for name, level, text, values in statuses:
            node = clean(name, _LONGEST_NAME)
            if node not in self._nodes and len(self._nodes) >= _MOST_NODES:
                continue
            self._nodes[node] = {
                'level': _LEVELS.get(level, 'error'),
                'text': clean(text, _LONGEST_TEXT),
                'values': [
                    [clean(key, _LONGEST_NAME), clean(value, _LONGEST_TEXT)]
                    for key, value in values[:_MOST_VALUES]
                ],
                'heard_s': now_s,
            }
        self._nodes = {
            name: node
            for name, node in self._nodes.items()
            if now_s - node['heard_s'] < _FORGOTTEN_S
        }
        self._nodes_version += 1

    def news(self, cursor: Cursor, now_s: float) -> dict[str, Any]:
        """The changes since the cursor, empty without any; the cursor is moved to now."""
        news: dict[str, Any] = {}
        trays = {
            str(number): tray.news(number, cursor, now_s)
            for number, tray in sorted(self._trays.items())
            if cursor.trays.get(number) != (tray.serial, tray.version)
        }
        if trays:
            news['trays'] = trays
        if cursor.nodes != self._nodes_version:
            cursor.nodes = self._nodes_version
            news['nodes'] = [
                {
                    'name': name,
                    **{key: value for key, value in node.items() if key != 'heard_s'},
                    'age': round(now_s - node['heard_s'], 1),
                }
                for name, node in sorted(self._nodes.items())
            ]
        return news


def columns() -> dict[str, list[str]]:
    """Names of the columns of each curve, as in the tables of `nanorocks analyse`."""
    named = {}
    for product in CURVES.values():
        named[product.name] = ['time', *product.curve]
    return named


def describe(tray: Tray | None) -> str:
    """The contents of a tray, in words."""
    if tray is None:
        return ''
    kinds = []
    for species in tray.species:
        low, high = 1e3 * species.diameter_low, 1e3 * species.diameter_high
        size = f'{low:.3g}' if low == high else f'{low:.3g} to {high:.3g}'
        count = 'any number of' if species.expected is None else species.expected
        kinds.append(f'{count} {species.material} {size} mm')
    return clean(', '.join(kinds) + (', with chalk' if tray.chalk else ''), _LONGEST_TEXT)


def clean(text: str, longest: int) -> str:
    """A text from outside: cut, unprintable characters replaced."""
    printable = ''.join(
        character if character.isprintable() else '\N{REPLACEMENT CHARACTER}' for character in text
    )
    return printable if len(printable) <= longest else f'{printable[: longest - 1]}…'
