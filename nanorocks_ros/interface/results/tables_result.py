"""Tables that a command wrote, read as they are.

Tested by ``test/interface/test_reading.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.results.result import Result, Summary, run_words
from nanorocks_ros.outputs.safe_text import counted

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure


class TablesResult(Result):
    """Tables by name, as `nanorocks_ros.read` finds them in a file or a folder.

    `tables` lists their names, `table` gives one; a table of a file has the name of the file.
    """

    def __init__(
        self,
        makers: Mapping[str, Callable[[], pd.DataFrame]],
        source: Path,
        run: Mapping[str, Any],
    ) -> None:
        super().__init__(provenance={**run_words(run), 'source': source.name}, notices=())
        self._frames = dict(makers)

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        return self._frames

    def _figure(self) -> Figure:
        first = self.tables[0]
        raise ConfigurationError(
            'plot', 'tables have no figure of their own', f'draw one: .table({first!r}).plot()'
        )

    def _summary(self) -> Summary:
        rows = []
        for name in self.tables:
            frame = self.table(name)
            rows.append((name, f'{len(frame)}', ', '.join(map(str, frame.columns))))
        return Summary(
            title=f'{self.provenance["source"]}: {counted(len(rows), "table")}',
            head=('table', 'rows', 'columns'),
            rows=tuple(rows),
        )
