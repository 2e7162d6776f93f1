"""The cooling window that `nanorocks analyse` used, from the table of restitutions it writes."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.outputs.tables.csv_tables import read_csv
from nanorocks_ros.records import CorStatus
from nanorocks_ros.studies.results.record_columns import number_of

if TYPE_CHECKING:
    from pathlib import Path

_FIELDS = 'status', 'window_start', 'window_end', 'cooling_start'


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingWindow:
    """The part of a cycle in which the gas cools freely.

    Parameters
    ----------
    first, last : float, [s]
        First and last speed used, since the shaking event.
    start : float, [s]
        When the gas begins to cool, since the shaking event.
    """

    first: float
    last: float
    start: float = 0.0


def cooling_window(speeds: Path) -> CoolingWindow | None:
    """The median cooling window of the cycles of a tray.

    Parameters
    ----------
    speeds : Path
        Table of speeds, ``tray_K_speed.csv``; ``tray_K_cor.csv`` beside it holds the window.

    Returns
    -------
    CoolingWindow or None
        Medians over the final estimates of the cycles; None without such estimates.
    """
    path = speeds.with_name(speeds.name.replace('_speed.csv', '_cor.csv'))
    if path == speeds or not path.is_file():
        return None
    try:
        names, lines = read_csv(path)
        rows = np.array(
            [[number_of(field, line[names.index(field)]) for field in _FIELDS] for line in lines]
        )
    except (OSError, ValueError, IndexError, csv.Error):
        return None
    if rows.ndim != 2:
        return None
    final = (rows[:, 0] == float(CorStatus.FINAL)) & np.isfinite(rows).all(axis=1)
    if not final.any():
        return None
    first, last, start = (float(median) for median in np.median(rows[final, 1:], axis=0))
    return CoolingWindow(first=first, last=last, start=start)


def span_of(
    first: float | None, last: float | None, usual: tuple[float, float]
) -> tuple[float, float]:
    """First and last time that is used, [s]: those given, else the usual ones.

    Raises
    ------
    ConfigurationError
        When they do not rise, or begin before the shaking event.
    """
    span = usual[0] if first is None else first, usual[1] if last is None else last
    if not 0.0 <= span[0] < span[1]:
        raise ConfigurationError(
            '--first, --last',
            f'{span[0]:g} to {span[1]:g} s',
            'give two times, rising, none below 0',
        )
    return span
