"""Result of a sweep: the mean decay at every point of a grid, and its files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.json_values import parse_object
from nanorocks_ros.outputs.npz_archive import read_archive, write_archive
from nanorocks_ros.outputs.tables.table_columns import Column, float_columns
from nanorocks_ros.outputs.tables.table_files import write_rows
from nanorocks_ros.studies.results.run_provenance import run_provenance
from nanorocks_ros.studies.sweeps.sweep_parts import COUNTS
from nanorocks_ros.studies.sweeps.sweep_plan import Axis

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.outputs.json_values import parse_object
    from nanorocks_ros.outputs.tables.table_columns import Kind
from nanorocks_ros.outputs.npz_archive import Arrays

CURVES = ('mean_speed', 'mean_speed_error', 'mean_projected_speed', 'mean_projected_speed_error')
_RUNS = ('run_mean_speed', 'run_mean_projected_speed')
_SPECIFICATION, _TIMES, _AXIS = 'question', 'times', 'axis_'


# By the type of the values of an axis; whole numbers count as numbers where one is not whole.
_KINDS: dict[type, Kind] = {bool: 'bool', int: 'int64', str: 'string'}


def _axis_column(axis: Axis, unit: str) -> Column:
    types = {type(value) for value in axis.values}
    kind = _KINDS.get(types.pop(), 'float64') if len(types) == 1 else 'float64'
    return Column(name=axis.name, kind=kind, unit=unit if kind in ('int64', 'float64') else '')


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Mean speeds of a cooling gas over the runs, at every point of a grid.

    Parameters
    ----------
    axes : tuple of Axis
        Settings that vary; empty for a single point, whose `grid` below is empty.
    times : ndarray (n_times,), [s]
        Since the shaking event.
    runs : int
        Runs at every point.
    specification : str
        JSON object with everything that the numbers depend on: version, settings with the seed,
        axes, times, runs, trays.
    mean_speed, mean_projected_speed : ndarray (*grid, n_times), [m/s]
        Over beads and runs.
    mean_speed_error, mean_projected_speed_error : ndarray (*grid, n_times), [m/s]
        One standard error, from the scatter of the runs; NaN for a single run. Errors at
        different times are correlated, since a slow run stays slow.
    pair_collisions, wall_collisions : ndarray of int64, (*grid,)
        Sums over the runs.
    run_mean_speed, run_mean_projected_speed : ndarray (*grid, n_runs, n_times) or None, [m/s]
        Speeds of each run, where the plan keeps them.
    """

    axes: tuple[Axis, ...]
    times: NDArray[np.float64]
    runs: int
    specification: str
    mean_speed: NDArray[np.float64]
    mean_speed_error: NDArray[np.float64]
    mean_projected_speed: NDArray[np.float64]
    mean_projected_speed_error: NDArray[np.float64]
    pair_collisions: NDArray[np.int64]
    wall_collisions: NDArray[np.int64]
    run_mean_speed: NDArray[np.float64] | None = None
    run_mean_projected_speed: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for array in (self.times, *self._arrays().values()):
            array.setflags(write=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    def _arrays(self) -> Arrays:
        arrays = {name: getattr(self, name) for name in (*CURVES, *COUNTS, *_RUNS)}
        return {name: array for name, array in arrays.items() if array is not None}

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file, complete or not at all.

        It holds the arrays by name, ``axis_NAME`` for each axis, and ``question``.

        Raises
        ------
        RecordingError
            When the file cannot be written.
        """
        axes = {f'{_AXIS}{axis.name}': np.array(axis.values) for axis in self.axes}
        specification = np.array(self.specification)
        write_archive(
            path, {_SPECIFICATION: specification, **axes, _TIMES: self.times, **self._arrays()}
        )

    @classmethod
    def load(cls, path: Path) -> Sweep:
        """Read a file that `save` wrote.

        Raises
        ------
        RecordingError
            When the file cannot be read, is damaged, or holds something else.
        """
        arrays = read_archive(path)
        try:
            specification = str(arrays[_SPECIFICATION])
            plan = parse_object(specification)
            _ = plan['settings']
            axes = tuple(
                Axis(name=name, values=tuple(values)) for name, values in plan['axes'].items()
            )
            sweep = cls(
                axes=axes,
                times=arrays[_TIMES],
                runs=plan['runs'],
                specification=specification,
                **{name: arrays[name] for name in (*CURVES, *COUNTS)},
                **{name: arrays[name] for name in _RUNS if name in arrays},
            )
            sweep._check_shapes()
        except (LookupError, ValueError, TypeError, AttributeError, OverflowError) as error:
            raise RecordingError(
                str(path), 'holds no sweep', 'name a file that `nanorocks sweep` wrote'
            ) from error
        return sweep

    def _check_shapes(self) -> None:
        times = (len(self.times),)
        ends = {**dict.fromkeys(CURVES, times), **dict.fromkeys(COUNTS, ())}
        ends.update(dict.fromkeys(_RUNS, (self.runs, *times)))
        for name, array in self._arrays().items():
            if array.shape != (*self.shape, *ends[name]):
                raise ValueError(f'{name} has the shape {array.shape}')

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Values of the axes, time and the four curves, point by point and time by time."""
        curves = [getattr(self, name) for name in CURVES]
        for index in np.ndindex(*self.shape):
            values = [axis.values[k] for axis, k in zip(self.axes, index, strict=True)]
            for k, time in enumerate(self.times.tolist()):
                yield (*values, time, *(float(curve[index][k]) for curve in curves))

    def columns(self, units: dict[str, str]) -> tuple[Column, ...]:
        """Columns of `rows`; units of the axes that have one."""
        curves = ['time', *CURVES]
        return (
            *(_axis_column(axis, units.get(axis.name) or '1') for axis in self.axes),
            *float_columns(curves, ['s', *('m/s' for _ in CURVES)]),
        )

    def write_table(self, path: Path, units: dict[str, str]) -> None:
        """Write the curves as a CSV table, complete or not at all.

        Parameters
        ----------
        path : Path
        units : dict of str to str
            Units of the axes that have one.

        Raises
        ------
        RecordingError
            When the file cannot be written.
        """
        provenance = {**run_provenance(), 'sweep': parse_object(self.specification)}
        write_rows(path, self.columns(units), self.rows(), provenance)
