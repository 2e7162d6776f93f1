"""The cooling window that `nanorocks analyse` used, from the table of restitutions it writes."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.records import CorStatus

if TYPE_CHECKING:
    from pathlib import Path

_FIELDS = 'status', 'window_start', 'window_end', 'cooling_start'


@dataclass(frozen=True, slots=True, kw_only=True)
class CoolingWindow:
    """What of a cycle is a gas that cools freely.

    Parameters
    ----------
    first, last : float, [s]
        First and last speed used, since the shaking event.
    start : float, [s]
        From when on the gas is taken to cool, since the shaking event.
    """

    first: float
    last: float
    start: float = 0.0


def cooling_window(speeds: Path) -> CoolingWindow | None:
    """The usual window of the cycles of a tray.

    Parameters
    ----------
    speeds : Path
        The table of speeds, ``tray_K_speed.csv``; read is ``tray_K_cor.csv`` beside it.

    Returns
    -------
    CoolingWindow or None
        Medians over the final estimates of the cycles; None where nothing says so.
    """
    path = speeds.with_name(speeds.name.replace('_speed.csv', '_cor.csv'))
    if path == speeds or not path.is_file():
        return None
    try:
        with path.open(encoding='utf-8', newline='') as stream:
            header, *lines = [line for line in csv.reader(stream) if line]
        names = [name.split('[')[0].strip() for name in header]
        rows = np.array([[float(line[names.index(field)]) for field in _FIELDS] for line in lines])
    except (OSError, ValueError, IndexError, csv.Error):
        return None
    if rows.ndim != 2:
        return None
    final = (rows[:, 0] == float(CorStatus.FINAL)) & np.isfinite(rows).all(axis=1)
    if not final.any():
        return None
    first, last, start = (float(one) for one in np.median(rows[final, 1:], axis=0))
    return CoolingWindow(first=first, last=last, start=start)


def span_of(
    first: float | None, last: float | None, usual: tuple[float, float]
) -> tuple[float, float]:
    """First and last time that is used, [s], as asked for with --first and --last or as usual.

    Raises
    ------
    ConfigurationError
        When they do not rise, or begin before the shaking event.
    """
    found = usual[0] if first is None else first, usual[1] if last is None else last
    if not 0.0 <= found[0] < found[1]:
        raise ConfigurationError(
            '--first, --last',
            f'{found[0]:g} to {found[1]:g} s',
            'give two times, rising, none below 0',
        )
    return found
