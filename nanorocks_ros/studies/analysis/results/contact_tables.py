"""Contacts of the cooling windows of a tray, from the tables that `nanorocks analyse` wrote.

Tested by ``test/studies/figures/test_impact_figure.py``.
"""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.inference.contacts.contact_terms import ContactTerms
from nanorocks_ros.inference.contacts.dragged_contacts import dragged
from nanorocks_ros.inference.flights.flight_losses import flight_losses, flight_table
from nanorocks_ros.outputs.tables.csv_tables import number, read_csv
from nanorocks_ros.records import NS, CorStatus, FreeFlight, Measured, PairCollision, Rebound
from nanorocks_ros.studies.analysis.results.result_tables import read_columns
from nanorocks_ros.wire.array_layouts import from_array
from nanorocks_ros.wire.products import ARRAY_TOPICS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from nanorocks_ros.inference.flights.flight_losses import FlightLosses
    from nanorocks_ros.records import ContactOrFlight
    from nanorocks_ros.settings import PriorSettings

_KINDS: tuple[type[ContactOrFlight], ...]
_KINDS = Rebound, PairCollision, FreeFlight
_WINDOW = 'time', 'cycle', 'status', 'window_start', 'window_end'
_ANALYSE = 'analyse the recording again'


def contacts_of_results(
    folders: Sequence[Path], tray: int, prior: PriorSettings
) -> tuple[ContactTerms, FlightLosses, int]:
    """What the contacts of a tray say, in the cooling windows of all cycles.

    Parameters
    ----------
    folders : sequence of Path
        Results of `nanorocks analyse`, one folder for each recording.
    tray : int
    prior : PriorSettings
        Of the drag of the gas.

    Returns
    -------
    terms : ContactTerms
    losses : FlightLosses
    cycles : int
        Number of those with a cooling window.

    Raises
    ------
    RecordingError
        When a table cannot be read, or no folder holds a cooling window of the tray.
    """
    seen: list[ContactOrFlight] = []
    cycles = 0
    for folder in folders:
        windows = _windows(folder, tray)
        cycles += len(windows)
        for kind in _KINDS:
            path = folder / f'tray_{tray}_{ARRAY_TOPICS[kind].name.rpartition("/")[2]}.csv'
            seen += [
                record
                for record in _records(path, kind, tray)
                if any(
                    record.cycle == cycle and first <= record.stamp_ns <= last
                    for cycle, first, last in windows
                )
            ]
    if not cycles:
        raise RecordingError(
            ', '.join(str(folder) for folder in folders),
            f'no cycle of tray {tray} cools freely',
            'name results of `nanorocks analyse` with a restitution of that tray',
        )
    flights = flight_table(record for record in seen if isinstance(record, FreeFlight))
    losses = flight_losses(flights, Measured(prior.drag, prior.drag_error))
    terms = ContactTerms.of(
        dragged(record, losses.drag.value) for record in seen if not isinstance(record, FreeFlight)
    )
    return terms, losses, cycles


def _windows(folder: Path, tray: int) -> list[tuple[int, int, int]]:
    """Number of each cycle, and first and last stamp of its cooling window, [ns]."""
    path = folder / f'tray_{tray}_cor.csv'
    if not path.is_file():
        return []
    columns = read_columns(path, _WINDOW)
    over = (columns['status'] == CorStatus.FINAL) | (columns['status'] == CorStatus.UNDETERMINED)
    over &= np.isfinite(columns['window_start'])
    return [
        (int(cycle), round((time - end + start) * NS), round(time * NS))
        for time, cycle, start, end in zip(
            *(columns[name][over] for name in ('time', 'cycle', 'window_start', 'window_end')),
            strict=True,
        )
    ]


def _records(path: Path, kind: type[ContactOrFlight], tray: int) -> Iterator[ContactOrFlight]:
    """The records of a table; none where it was not written."""
    if not path.is_file():
        return
    try:
        _, rows = read_csv(path)
        for row in rows:
            yield from_array(
                kind, [number(cell) for cell in row], tray=tray, epoch_ns=0, where=str(path)
            )
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another folder'
        ) from error
    except (ValueError, csv.Error, FrameError) as error:
        raise RecordingError(str(path), 'is no table of contacts', _ANALYSE) from error
