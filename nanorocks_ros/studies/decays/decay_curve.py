"""A decay of the mean projected speed: from a file, or from a point of a sweep."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.outputs.npz_archive import read_archive
from nanorocks_ros.outputs.tables.csv_tables import number, read_csv

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.settings import Scalar
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

_TIME, _SPEED, _ERROR = 'time', 'mean_projected_speed', 'mean_projected_speed_error'
_FORM = f'give the columns {_TIME} [s], {_SPEED} [m/s] and, if known, {_ERROR} [m/s]'
# Relative and absolute tolerance of equal decimal values.
_EQUAL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedCurve:
    """Mean projected speed of a cooling gas.

    Parameters
    ----------
    times : ndarray (n,), [s]
        Since the shaking event; rising.
    speed : ndarray (n,), [m/s]
    error : ndarray (n,), [m/s]
        One standard error; 0 where it is not known.
    point : tuple of float, int, str or bool, or None
        Point of the grid of a sweep that the curve is from.
    cycles : int or None
        Number of measured decays that it is the mean of; None for a simulated curve, or when
        not known: then `error` includes all of its scatter.
    """

    times: NDArray[np.float64]
    speed: NDArray[np.float64]
    error: NDArray[np.float64]
    point: tuple[Scalar, ...] | None = None
    cycles: int | None = None


def read_curve(path: Path) -> SpeedCurve:
    """Read a curve from a CSV table, or an ``.npz`` file such as a sweep of a single point.

    Parameters
    ----------
    path : Path
        Columns, or arrays, `time` (or `times`), `mean_projected_speed` and, if known,
        `mean_projected_speed_error`, in SI units; a unit may follow in brackets.

    Raises
    ------
    RecordingError
        When the file cannot be read or holds no such curve.
    """
    columns = _arrays(path) if path.suffix == '.npz' else _table(path)
    if _TIME not in columns or _SPEED not in columns:
        raise RecordingError(str(path), 'holds no curve', _FORM)
    times, speed = columns[_TIME], columns[_SPEED]
    error = columns.get(_ERROR, np.zeros_like(times))
    if not times.ndim == speed.ndim == error.ndim == 1 or not len(times) == len(speed) == len(
        error
    ):
        raise RecordingError(
            str(path), f'{_SPEED} has the shape {speed.shape}', 'name a file of one curve'
        )
    finite = np.isfinite(times) & np.isfinite(speed)
    times, speed, error = times[finite], speed[finite], np.nan_to_num(error[finite])
    if len(times) < 2 or (np.diff(times) <= 0.0).any():
        raise RecordingError(str(path), 'its times do not rise', 'name a file of one decay')
    return SpeedCurve(times=times, speed=speed, error=error)


def _arrays(path: Path) -> dict[str, NDArray[np.float64]]:
    content = read_archive(path)
    numbers = {name: array for name, array in content.items() if array.dtype.kind in 'fiu'}
    if 'times' in numbers:
        numbers[_TIME] = numbers['times']
    return {name: array.astype(np.float64) for name, array in numbers.items()}


def _table(path: Path) -> dict[str, NDArray[np.float64]]:
    try:
        names, lines = read_csv(path)
        wanted = [k for k, name in enumerate(names) if name in (_TIME, _SPEED, _ERROR)]
        values = [[number(line[k]) for k in wanted] for line in lines]
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'name another file'
        ) from error
    except (ValueError, IndexError, csv.Error) as error:
        raise RecordingError(str(path), 'is no table of numbers', _FORM) from error
    columns = np.array(values, dtype=np.float64).reshape(len(values), len(wanted)).T
    return {names[k]: column for k, column in zip(wanted, columns, strict=True)}


def curve_at(sweep: Sweep, values: Sequence[Scalar]) -> SpeedCurve:
    """The mean curve at a point of a sweep.

    Parameters
    ----------
    sweep : Sweep
    values : sequence of float, int, str or bool, (n_axes,)

    Raises
    ------
    ConfigurationError
        When the grid has no such point.
    """
    index = place_of({axis.name: axis.values for axis in sweep.axes}, values)
    return SpeedCurve(
        times=sweep.times,
        speed=sweep.mean_projected_speed[index],
        error=np.nan_to_num(sweep.mean_projected_speed_error[index]),
        point=tuple(axis.values[k] for axis, k in zip(sweep.axes, index, strict=True)),
    )


def place_of(axes: dict[str, tuple[Scalar, ...]], values: Sequence[Scalar]) -> tuple[int, ...]:
    """Indices of a point of a grid.

    Parameters
    ----------
    axes : dict of str to tuple
        Names and values of the axes.
    values : sequence of float, int, str or bool, (n_axes,)

    Raises
    ------
    ConfigurationError
        When the grid has no such point.
    """
    if len(values) != len(axes):
        raise ConfigurationError(
            '--reference',
            f'{len(values)} values for {len(axes)} axes',
            f'give one each for {", ".join(axes) or "no axis"}',
        )
    indices = []
    for (name, axis_values), value in zip(axes.items(), values, strict=True):
        matches = [k for k, axis_value in enumerate(axis_values) if _equal(axis_value, value)]
        if not matches:
            shown = ', '.join(str(axis_value) for axis_value in axis_values)
            raise ConfigurationError('--reference', f'{name} {value}', f'choose one of {shown}')
        indices.append(matches[0])
    return tuple(indices)


def _equal(first: Scalar, second: Scalar) -> bool:
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=_EQUAL, abs_tol=_EQUAL)
    return first == second
