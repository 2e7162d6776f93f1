"""Cycles of a recording, from the table of speeds that `nanorocks analyse` writes."""

from __future__ import annotations

import csv
import math
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, RecordingError, did_you_mean_file
from nanorocks_ros.outputs.tables.csv_tables import number, read_csv
from nanorocks_ros.recordings.film.video_streams import VIDEO_SUFFIXES
from nanorocks_ros.studies.decays.decay_curve import SpeedCurve, read_curve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

MEAN = 'mean_projected_speed'
_COLUMNS = ('time', 'cycle', 'cycle_start')
_FORM = 'name the results of `nanorocks analyse`, or their tray_K_speed.csv'
_TABLE = 'tray_{}_speed.csv'
# Least number of speeds of a decay.
_MIN_SPEEDS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleSpeeds:
    """Mean projected speeds after one shaking event.

    Parameters
    ----------
    cycle : int
    times : ndarray (n,), [s]
        Since the shaking event, rising.
    speed, error : ndarray (n,), [m/s]
        Never NaN; an error of 0 means that it is not known.
    """

    cycle: int
    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    error: NDArray[np.float64]


def speed_table(path: Path, tray: int | None = None) -> tuple[Path, int | None]:
    """Path of the table of speeds of a tray, and the number of the tray if the name has it.

    Parameters
    ----------
    path : Path
        Folder of results, or a table.
    tray : int, optional
        Needed where the folder holds several.

    Raises
    ------
    RecordingError
        When there is no table, or several and no number to choose one.
    ConfigurationError
        When the name has the number of another tray.
    """
    if not path.exists():
        raise RecordingError(str(path), 'does not exist', did_you_mean_file(path) or _FORM)
    if not path.is_dir():
        parts = path.stem.split('_')
        if path.suffix.lower() in VIDEO_SUFFIXES:
            first = f'analyse it first: nanorocks analyse {shlex.quote(str(path))}'
            raise RecordingError(str(path), 'is a film, no table of speeds', first)
        has_number = parts[:1] == ['tray'] and len(parts) > 1 and parts[1].isdigit()
        own = int(parts[1]) if has_number else None
        if own is not None and tray not in (None, own):
            raise ConfigurationError(
                '--tray', f'{tray}, but {path.name} is of tray {own}', f'leave out --tray {tray}'
            )
        return path, tray if own is None else own
    numbers = sorted(
        int(table.stem.split('_')[1])
        for table in path.glob(_TABLE.format('*'))
        if table.stem.split('_')[1].isdigit()
    )
    if tray is None and len(numbers) != 1:
        raise _no_single_tray(path, numbers)
    number = numbers[0] if tray is None else tray
    if number not in numbers:
        raise RecordingError(str(path), f'holds no speeds of tray {number}', _FORM)
    return path / _TABLE.format(number), number


def _no_single_tray(path: Path, numbers: list[int]) -> RecordingError:
    """The error of a folder with the speeds of no tray, or of several."""
    if numbers:
        listed = ', '.join(str(number) for number in numbers)
        return RecordingError(
            str(path), f'holds speeds of trays {listed}', f'name one, as --tray {numbers[0]}'
        )
    # As by `nanorocks measure` and by batches.
    below = min((table.parent for table in path.rglob(_TABLE.format('*'))), default=None)
    return RecordingError(
        str(path), 'holds no speeds of a tray', _FORM if below is None else f'name {below}'
    )


def read_cycles(path: Path, speed: str = MEAN) -> tuple[CycleSpeeds, ...]:
    """Read the cycles of a table of speeds, without those before the first shaking event.

    Parameters
    ----------
    path : Path
        CSV table with the columns time, cycle, cycle_start [s] and a speed with its error [m/s].
    speed : str, optional
        Column of the speed.

    Raises
    ------
    RecordingError
        When the table cannot be read, or holds no cycle.
    """
    rows = _rows(path, (*_COLUMNS, speed, f'{speed}_error'))
    usable = np.isfinite(rows[:, :4]).all(axis=1) & (rows[:, 3] > 0.0)
    rows = rows[usable]
    # A recording that was played twice holds cycle 1 twice, with different shaking events.
    keys = list(dict.fromkeys(zip(rows[:, 1].tolist(), rows[:, 2].tolist(), strict=True)))
    cycles = []
    for cycle, start in keys:
        cycle_rows = rows[(rows[:, 1] == cycle) & (rows[:, 2] == start)]
        times = cycle_rows[:, 0] - start
        rising = np.concatenate(([True], np.diff(times) > 0.0)) & (times >= 0.0)
        if rising.sum() >= _MIN_SPEEDS:
            cycles.append(
                CycleSpeeds(
                    cycle=int(cycle),
                    times=times[rising],
                    speed=cycle_rows[rising, 3],
                    error=np.nan_to_num(cycle_rows[rising, 4]),
                )
            )
    if not cycles:
        raise RecordingError(str(path), 'holds no decay after a shaking event', _FORM)
    return tuple(cycles)


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
        return tuple(
            read_cycles(path, f'{ordinal}_species_speed') for ordinal in ('first', 'second')
        )
    except RecordingError:
        return ()


def _rows(path: Path, columns: tuple[str, ...]) -> NDArray[np.float64]:
    """Columns of a table, (n, n_columns)."""
    try:
        names, lines = read_csv(path)
        indices = [names.index(name) for name in columns]
        values = [[number(line[k]) for k in indices] for line in lines]
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
    """Cycles and span in times since the gas began to cool, without earlier speeds.

    Parameters
    ----------
    cycles : sequence of CycleSpeeds
    span : tuple of 2 floats, [s]
        First and last time that is used, since the shaking event.
    start : float, [s]
        When the gas began to cool, since the shaking event; the start of the span if that is
        earlier.
    """
    start = min(start, span[0])
    cooling = []
    for cycle in cycles:
        late = cycle.times >= start
        cooling.append(
            CycleSpeeds(
                cycle=cycle.cycle,
                times=cycle.times[late] - start,
                speed=cycle.speed[late],
                error=cycle.error[late],
            )
        )
    return tuple(cooling), (span[0] - start, span[1] - start)


def mean_cycle(
    cycles: Sequence[CycleSpeeds], first: float = 0.0, last: float = math.inf
) -> SpeedCurve:
    """The mean decay over cycles, at evenly spaced times that all of them cover.

    Parameters
    ----------
    cycles : sequence of CycleSpeeds
        One or more.
    first, last : float, [s]
        Since the shaking event.

    Returns
    -------
    SpeedCurve
        Its error is that of the measurement alone, without the scatter of the gas from cycle
        to cycle.

    Raises
    ------
    RecordingError
        When the cycles have fewer than 4 times in common between these ends.
    """
    start = max(first, *(cycle.times[0] for cycle in cycles), 0.0)
    end = min(last, *(cycle.times[-1] for cycle in cycles), math.inf)
    step = float(np.median(np.concatenate([np.diff(cycle.times) for cycle in cycles])))
    count = int((end - start) / step + 1e-6) + 1 if end >= start else 0
    if count < _MIN_SPEEDS:
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
    """Raise for speeds without errors.

    Raises
    ------
    RecordingError
        When an error is not known.
    """
    if not (curve.error > 0.0).all():
        raise RecordingError(
            'mean_projected_speed_error',
            'is not known for every speed',
            'name the results of `nanorocks analyse`',
        )


def read_decay(path: Path) -> SpeedCurve:
    """Read a decay from any file: a curve, or the mean over the cycles of a table of speeds.

    Parameters
    ----------
    path : Path
        A file for `read_curve`, a table that `nanorocks analyse` wrote, or a folder of results
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
        names, _ = read_csv(path)
    except (OSError, ValueError, csv.Error):
        # `read_curve` raises for what is wrong with the file.
        return False
    return 'cycle_start' in names
