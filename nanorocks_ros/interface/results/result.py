"""What all results have in common: tables, words, a summary for terminal and notebook.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

import html
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.python_words import python_words

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure
    from typing_extensions import Self

_CELL = 'style="text-align:left;padding:.15em .8em"'


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """A result in a few lines.

    Parameters
    ----------
    title : str
    head : tuple of str
        Of the columns of the table.
    rows : tuple of tuples of str
    lines : tuple of str
        What is wrong, and what to do about it; assumptions.
    """

    title: str
    head: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    lines: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Lines for a terminal."""
        cells = [self.head, *self.rows] if self.rows else []
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        table = [
            '  '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
            for row in cells
        ]
        return '\n'.join([self.title, *table, *self.lines])

    def as_html(self) -> str:
        """A table and a list for a notebook."""
        head = ''.join(f'<th {_CELL}>{html.escape(cell)}</th>' for cell in self.head)
        rows = ''.join(
            '<tr>' + ''.join(f'<td {_CELL}>{html.escape(cell)}</td>' for cell in row) + '</tr>'
            for row in self.rows
        )
        table = f'<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>'
        items = ''.join(f'<li>{html.escape(line)}</li>' for line in self.lines)
        return (
            f'<div><p><b>{html.escape(self.title)}</b></p>'
            + (table if self.rows else '')
            + (f'<ul>{items}</ul>' if items else '')
            + '</div>'
        )


class NamedTable(property):
    """A table of a `Result`, as its attribute of the same name.

    Parameters
    ----------
    doc : str
        What a row is.
    """

    def __init__(self, doc: str) -> None:
        super().__init__()
        # `property` leaves that of the class.
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self._table = name

    @overload
    def __get__(self, result: None, owner: type | None = None) -> Self: ...

    @overload
    def __get__(self, result: Result, owner: type | None = None) -> pd.DataFrame: ...

    def __get__(self, result: Result | None, owner: type | None = None) -> Self | pd.DataFrame:
        return self if result is None else result.table(self._table)


class Result:
    """A result of an analysis, a measurement or a simulation.

    Every table is a pandas DataFrame, made when it is first asked for: SI units, words in place
    of codes. ``attrs['units']`` has the unit of each column, ``attrs['provenance']`` what made it.

    Attributes
    ----------
    provenance : dict of str to str
        Version, recordings, settings.
    notices : tuple of str
        What the user should know: assumptions, gaps, damage; one line each.
    usable : bool
        Whether the beads were recognised well enough to use the result.
    """

    def __init__(
        self, *, provenance: Mapping[str, str], notices: tuple[str, ...], usable: bool = True
    ) -> None:
        self.provenance = {'nanorocks_ros': __version__, **provenance}
        self.notices = tuple(python_words(notice) for notice in notices)
        self.usable = usable
        self._tables: dict[str, pd.DataFrame] = {}

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that `table` gives."""
        return tuple(self._makers())

    def table(self, name: str) -> pd.DataFrame:
        """A table by its name.

        Parameters
        ----------
        name : str
            One of `tables`.

        Raises
        ------
        ConfigurationError
            When there is no such table, or it was not kept.
        """
        if name not in self._tables:
            makers = self._makers()
            if name not in makers:
                raise ConfigurationError(
                    f'table {name!r}', 'does not exist', f'choose from {", ".join(makers)}'
                )
            frame = makers[name]()
            frame.attrs['provenance'] = {
                **frame.attrs.get('provenance', {}),
                **self.provenance,
            }
            self._tables[name] = frame
        return self._tables[name]

    def plot(self) -> Figure:
        """The result as a figure of Matplotlib."""
        figure = self._figure()
        _show_in_notebook(type(figure))
        return figure

    @property
    def _verdict(self) -> str:
        """What a title says after its subject when the result must not be used."""
        return '' if self.usable else ': NOT USABLE'

    def _makers(self) -> dict[str, Any]:
        """A function for each table."""
        raise NotImplementedError

    def _figure(self) -> Figure:
        raise NotImplementedError

    def _summary(self) -> Summary:
        raise NotImplementedError

    def __repr__(self) -> str:
        return self._summary().as_text()

    def _repr_html_(self) -> str:
        return self._summary().as_html()


def run_words(run: Mapping[str, Any]) -> dict[str, str]:
    """What tables say of the run that made them: version, date and command, where they are told.

    Parameters
    ----------
    run : mapping
        As of `run_provenance`.
    """
    words = {name: str(run[name]) for name in ('created', 'command') if run.get(name)}
    version = run.get('versions', {}).get('nanorocks_ros')
    return {'nanorocks_ros': str(version), **words} if version else words


def _show_in_notebook(figure_type: type) -> None:
    """Let a notebook draw figures, which it learns only with pyplot."""
    module = sys.modules.get('IPython')
    shell: Any = None if module is None else module.get_ipython()
    if not hasattr(shell, 'kernel'):
        return
    formatter = shell.display_formatter.formatters['image/png']
    if figure_type not in formatter.type_printers:
        from IPython.core import pylabtools

        register: Any = pylabtools.select_figure_formats
        register(shell, {'png'})
