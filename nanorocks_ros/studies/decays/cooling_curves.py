"""Cycles of a recording, from the table of speeds that `nanorocks analyse` writes."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.studies.decays.decay_curve import SpeedCurve, read_curve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

MEAN = 'mean_projected_speed'
_COLUMNS = ('time', 'cycle', 'cycle_start')
_FORM = 'name the results of `nanorocks analyse`, or their tray_K_speed.csv'
_TABLE = 'tray_{}_speed.csv'
# Fewer speeds are no decay.
_FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSpeeds:
    """Mean projected speeds after one shaking event.

    Parameters
    ----------
    cycle : int
    times : ndarray (n,), [s]
        Since the shaking event, rising.
    speed, error : ndarray (n,), [m/s]
        NaN nowhere; an error of 0 is not known.
    """

    cycle: int
    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    error: NDArray[np.float64]


def speed_table(path: Path, tray: int | None = None) -> tuple[Path, int | None]:
    """The table of speeds of a tray, and the number of the tray where the name says it.

    Parameters
    ----------
    path : Path
        Folder of results, or a table.
    tray : int, optional
        Needed where the folder holds several.

    Raises
    ------
    RecordingError
        When there is none, or more than one to choose from.
    """
    if not path.is_dir():
        parts = path.stem.split('_')
        named = parts[:1] == ['tray'] and len(parts) > 1 and parts[1].isdigit()
        return path, tray if tray is not None else int(parts[1]) if named else None
    numbers = sorted(
        int(one.stem.split('_')[1])
        for one in path.glob(_TABLE.format('*'))
        if one.stem.split('_')[1].isdigit()
    )
    if tray is None and len(numbers) != 1:
        known = ', '.join(str(one) for one in numbers) or 'none'
        raise RecordingError(str(path), f'holds speeds of trays: {known}', 'name one with --tray')
    number = numbers[0] if tray is None else tray
    if number not in numbers:
        raise RecordingError(str(path), f'holds no speeds of tray {number}', _FORM)
    return path / _TABLE.format(number), number


def read_cycles(path: Path, speed: str = MEAN) -> tuple[CycleSpeeds, ...]:
    """The cycles of a table of speeds; what comes before the first shaking event is left out.

    Parameters
    ----------
    path : Path
        CSV table with the columns time, cycle, cycle_start [s] and a speed with its error [m/s].
    speed : str, optional
        Which speed.

    Raises
    ------
    RecordingError
        When it cannot be read, or holds no cycle.
    """
    rows = _rows(path, (*_COLUMNS, speed, f'{speed}_error'))
    known = np.isfinite(rows[:, :4]).all(axis=1) & (rows[:, 3] > 0.0)
    rows = rows[known]
    # A recording that was played twice holds cycle 1 twice, from different shaking events.
    keys = list(dict.fromkeys(zip(rows[:, 1].tolist(), rows[:, 2].tolist(), strict=True)))
    found = []
    for cycle, start in keys:
        own = rows[(rows[:, 1] == cycle) & (rows[:, 2] == start)]
        times = own[:, 0] - start
        later = np.concatenate(([True], np.diff(times) > 0.0)) & (times >= 0.0)
        if later.sum() >= _FEWEST:
            found.append(
                CycleSpeeds(
                    cycle=int(cycle),
                    times=times[later],
                    speed=own[later, 3],
                    error=np.nan_to_num(own[later, 4]),
                )
            )
    if not found:
        raise RecordingError(str(path), 'holds no decay after a shaking event', _FORM)
    return tuple(found)


def species_cycles(path: Path, tray: Tray) -> tuple[tuple[CycleSpeeds, ...], ...]:
    """The cycles of each species of a mixture, in the order of `Tray.species`.

    Parameters
    ----------
    path : Path
        As for `read_cycles`.
    tray : Tray

    Returns
    -------
    tuple of tuples of CycleSpeeds
        Empty for a single species, or when the table does not hold the speeds of two.
    """
    if len(tray.species) < 2:
        return ()
    try:
        return tuple(read_cycles(path, f'{one}_species_speed') for one in ('first', 'second'))
    except RecordingError:
        return ()


def _rows(path: Path, columns: tuple[str, ...]) -> NDArray[np.float64]:
    """Columns of a table, (n, n_columns)."""
    try:
        with path.open(encoding='utf-8', newline='') as stream:
            header, *lines = [line for line in csv.reader(stream) if line]
        names = [name.split('[')[0].strip() for name in header]
        places = [names.index(name) for name in columns]
        values = [[float(line[k]) for k in places] for line in lines]
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another file'
        ) from error
    except (ValueError, IndexError, csv.Error) as error:
        raise RecordingError(str(path), 'is no table of speeds by cycle', _FORM) from error
    return np.array(values, dtype=np.float64).reshape(len(values), len(columns))


def cooling_part(
    cycles: Sequence[CycleSpeeds], span: tuple[float, float], start: float
) -> tuple[tuple[CycleSpeeds, ...], tuple[float, float]]:
    """Cycles and span in times since the gas began to cool; speeds before that are left out.

    Parameters
    ----------
    cycles : sequence of CycleSpeeds
    span : tuple of 2 floats, [s]
        First and last time that is used, since the shaking event.
    start : float, [s]
        When the gas began to cool, since the shaking event. A span that begins earlier is
        believed instead.
    """
    start = min(start, span[0])
    found = []
    for one in cycles:
        late = one.times >= start
        found.append(
            CycleSpeeds(
                cycle=one.cycle,
                times=one.times[late] - start,
                speed=one.speed[late],
                error=one.error[late],
            )
        )
    return tuple(found), (span[0] - start, span[1] - start)


def mean_cycle(
    cycles: Sequence[CycleSpeeds], first: float = 0.0, last: float = math.inf
) -> SpeedCurve:
    """The mean decay over cycles, at even times that all of them cover.

    Parameters
    ----------
    cycles : sequence of CycleSpeeds
        One or more.
    first, last : float, [s]
        Since the shaking event.

    Returns
    -------
    SpeedCurve
        Its error is that of the measurement alone: the scatter of the gas from one cycle to the
        next comes on top of it.

    Raises
    ------
    RecordingError
        When the cycles have fewer than 4 times in common between these ends.
    """
    start = max(first, *(cycle.times[0] for cycle in cycles), 0.0)
    end = min(last, *(cycle.times[-1] for cycle in cycles), math.inf)
    step = float(np.median(np.concatenate([np.diff(cycle.times) for cycle in cycles])))
    count = int((end - start) / step + 1e-6) + 1 if end >= start else 0
    if count < _FEWEST:
        raise RecordingError(
            f'{len(cycles)} cycles',
            f'have {count} speeds in common between {first:g} and {last:g} s',
            'choose a longer time, or leave out short cycles',
        )
    times = start + step * np.arange(count)
    speeds = [np.interp(times, cycle.times, cycle.speed) for cycle in cycles]
    errors = [np.interp(times, cycle.times, cycle.error) for cycle in cycles]
    return SpeedCurve(
        times=times,
        speed=np.mean(speeds, axis=0),
        error=np.sqrt(np.square(errors).sum(axis=0)) / len(cycles),
        cycles=len(cycles),
    )


def check_errors(curve: SpeedCurve) -> None:
    """Refuse speeds whose errors are not known.

    Raises
    ------
    RecordingError
    """
    if not (curve.error > 0.0).all():
        raise RecordingError(
            'mean_projected_speed_error',
            'is not known for every speed',
            'name the results of `nanorocks analyse`',
        )


def read_decay(path: Path) -> SpeedCurve:
    """One decay from any file: a curve, or the mean over the cycles of a table of speeds.

    Parameters
    ----------
    path : Path
        What `read_curve` takes, a table that `nanorocks analyse` wrote, or a folder of results
        of a single tray.

    Raises
    ------
    RecordingError
        When the file cannot be read or holds no decay.
    """
    path, _ = speed_table(path)
    if path.suffix == '.csv' and _has_cycles(path):
        return mean_cycle(read_cycles(path))
    return read_curve(path)


def _has_cycles(path: Path) -> bool:
    try:
        with path.open(encoding='utf-8', newline='') as stream:
            header = next(csv.reader(stream), [])
    except (OSError, ValueError, csv.Error):
        # Whoever reads the curve says what is wrong.
        return False
    return 'cycle_start' in {name.split('[')[0].strip() for name in header}
