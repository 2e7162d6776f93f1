"""Records as pandas DataFrames: SI units, words in place of codes, provenance in ``attrs``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from nanorocks_ros.studies.results.record_columns import columns_of, record_arrays

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.tables.table_columns import Column
    from nanorocks_ros.records import ArrayRecord


def frame_of(
    kind: type[ArrayRecord], records: Sequence[ArrayRecord], epoch_ns: int
) -> pd.DataFrame:
    """A row for each record, with the columns of its array.

    Parameters
    ----------
    kind : type
        Of the records; there may be none.
    records : sequence of ArrayRecord
    epoch_ns : int, [ns]
        What times count from.

    Returns
    -------
    DataFrame
        With ``attrs['units']``, a unit by column.
    """
    columns: dict[str, NDArray[Any]] = {
        'tray': np.array([record.tray for record in records], dtype=np.int64),
        **record_arrays(kind, records, epoch_ns),
    }
    frame = pd.DataFrame(columns)
    units = {column.name: column.unit for column in columns_of(kind)}
    frame.attrs['units'] = {'tray': '1', **units}
    return frame


def joined(frames: Iterable[pd.DataFrame], **attributes: Any) -> pd.DataFrame:
    """Frames of the same columns below each other, with units and further attributes.

    Parameters
    ----------
    frames : iterable of DataFrame
        At least one.
    **attributes
        Added to ``attrs``.
    """
    parts = list(frames)
    filled = [part for part in parts if len(part)] or parts[:1]
    units = parts[0].attrs.get('units', {})
    for part in filled:
        # pandas compares them, which takes long.
        part.attrs = {}
    whole = pd.concat(filled, ignore_index=True)
    whole.attrs['units'] = dict(units)
    whole.attrs.update(attributes)
    return whole


def with_column(
    frame: pd.DataFrame, place: int, name: str, value: Any, unit: str = ''
) -> pd.DataFrame:
    """The frame with a column more, at a place."""
    units = frame.attrs.get('units', {})
    frame.insert(place, name, value)
    frame.attrs['units'] = {column: units.get(column, unit) for column in frame.columns}
    return frame


def table_frame(
    columns: Sequence[Column], pieces: Iterable[Mapping[str, NDArray[Any]]]
) -> pd.DataFrame:
    """A frame of the columns of a table that comes in pieces.

    Parameters
    ----------
    columns : sequence of Column
    pieces : iterable of mapping of str to ndarray
        Rows by column; there may be more columns than are wanted.
    """
    rows = list(pieces)
    frame = pd.DataFrame(
        {
            column.name: np.concatenate([piece[column.name] for piece in rows]) if rows else []
            for column in columns
        }
    )
    for column in columns:
        # Whole numbers of which some are not known.
        if column.kind == 'int64' and frame[column.name].dtype == object:
            frame[column.name] = frame[column.name].astype('Int64')
    frame.attrs['units'] = {column.name: column.unit for column in columns}
    return frame
