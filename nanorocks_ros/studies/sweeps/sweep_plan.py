"""Plan of a sweep: settings, grid, times, number of runs."""

from __future__ import annotations

import itertools
import json
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number, tray_values
from nanorocks_ros.settings import SimulationSettings, rows, with_values

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import Scalar, Value

MAX_RUNS = 2**31
MAX_POINTS = 10**6


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One setting and its values along one axis of the grid.

    Parameters
    ----------
    name : str
        Of a field of `SimulationSettings`.
    values : tuple of float, int, str or bool, (n_values,)
    """

    name: str
    values: tuple[Scalar, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepPlan:
    """A plan whose result does not depend on the workers.

    Make one with `sweep_plan`, which checks it. Points of the grid are numbered with the last
    axis running fastest.

    Parameters
    ----------
    settings : SimulationSettings
        Settings that no axis varies; the seed determines all random numbers.
    axes : tuple of Axis
        Empty: a single point.
    times : tuple of float, (n_times,), [s]
        Since the shaking event; rising.
    runs : int
        Runs at every point.
    common_random_numbers : bool
        Whether run k has the same random numbers at every point: differences between points are
        less noisy, but their errors are correlated. By default all runs are independent.
    keep_runs : bool
        Whether the result holds each run, for covariances, beside the means.
    trays : tuple of Tray
        Trays of the grid, in order of their number.
    """

    settings: SimulationSettings
    axes: tuple[Axis, ...]
    times: tuple[float, ...]
    runs: int
    common_random_numbers: bool = False
    keep_runs: bool = False
    trays: tuple[Tray, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def points(self) -> int:
        """Number of points of the grid."""
        return math.prod(self.shape)

    @property
    def total_runs(self) -> int:
        """Number of runs over the whole grid."""
        return self.points * self.runs

    def point(self, number: int) -> tuple[SimulationSettings, Tray]:
        """Settings and tray of a point of the grid.

        Parameters
        ----------
        number : int, from 0
        """
        indices = np.unravel_index(number, self.shape)
        values = {
            axis.name: axis.values[int(index)]
            for axis, index in zip(self.axes, indices, strict=True)
        }
        settings = with_values(self.settings, values, 'sweep')
        (tray,) = (tray for tray in self.trays if tray.number == settings.tray)
        return settings, tray

    def name(self, number: int) -> str:
        """Description of a point of the grid, for messages."""
        indices = np.unravel_index(number, self.shape)
        return ', '.join(
            f'{axis.name} {axis.values[int(index)]}'
            for axis, index in zip(self.axes, indices, strict=True)
        )

    def run_numbers(self, point: int, first: int, last: int) -> list[int]:
        """Numbers of the runs first, first + 1, ..., last - 1 of a point.

        Run k of point p is number 2^32 p + k of the root seed: numpy's `SeedSequence` takes
        the two halves as separate words, so no two runs share random numbers, and adding
        runs or points does not change the others.
        """
        offset = 0 if self.common_random_numbers else point << 32
        return [offset + run for run in range(first, last)]

    def specification(self) -> str:
        """Everything that the result depends on, as a JSON object."""
        return json.dumps(
            {
                'version': __version__,
                'runs': self.runs,
                'common_random_numbers': self.common_random_numbers,
                'axes': {axis.name: axis.values for axis in self.axes},
                'times': self.times,
                'settings': {row.name: row.default for row in rows(self.settings)},
                'trays': {str(tray.number): tray_values(tray) for tray in self.trays},
            }
        )


def sweep_plan(
    settings: SimulationSettings,
    axes: Mapping[str, Sequence[Scalar]],
    times: Sequence[float] | NDArray[np.float64],
    runs: int,
    *,
    common_random_numbers: bool = False,
    keep_runs: bool = False,
) -> SweepPlan:
    """Make a plan, checked.

    Parameters
    ----------
    settings : SimulationSettings
    axes : mapping of str to sequences
        Values by field of `SimulationSettings`, each once. Empty: a single point.
    times : array_like (n_times,), [s]
        Since the shaking event; rising.
    runs : int, > 0
        Runs at every point.
    common_random_numbers, keep_runs : bool, optional
        See `SweepPlan`.

    Raises
    ------
    ConfigurationError
        For an unknown field, a value outside its range, or times that do not rise.
    """
    settings = with_values(settings, {row.name: row.default for row in rows(settings)}, 'settings')
    checked = tuple(_axis(settings, name, values) for name, values in axes.items())
    if isinstance(runs, bool) or not isinstance(runs, int) or not 1 <= runs <= MAX_RUNS:
        raise ConfigurationError(
            '--runs', f'{runs!r}', f'give a whole number from 1 to {MAX_RUNS}'
        )
    points = math.prod(len(axis.values) for axis in checked)
    if points > MAX_POINTS:
        raise ConfigurationError(
            'sweep', f'a grid of {points} points', f'give at most {MAX_POINTS}'
        )
    numbers = next((axis.values for axis in checked if axis.name == 'tray'), (settings.tray,))
    return SweepPlan(
        settings=settings,
        axes=checked,
        times=_times(times),
        runs=runs,
        common_random_numbers=common_random_numbers,
        keep_runs=keep_runs,
        trays=_trays(numbers),
    )


def _axis(settings: SimulationSettings, name: str, values: Iterable[Any]) -> Axis:
    settings_by_name: dict[str, Value] = {}
    plain = [value.item() if isinstance(value, np.generic) else value for value in values]
    where = f'axis {name}'
    if not plain:
        raise ConfigurationError(where, 'has no values', 'give one or more')
    converted = []
    for value in plain:
        changed = with_values(settings, {name: value}, where)
        settings_by_name = {row.name: row.default for row in rows(changed)}
        converted.append(settings_by_name[name])
    if any(isinstance(value, tuple) for value in converted):
        raise ConfigurationError(where, 'is a list by itself', 'vary a single number')
    if len(set(converted)) < len(converted):
        raise ConfigurationError(where, 'holds a value twice', 'give each value once')
    return Axis(name=name, values=tuple(converted))  # type: ignore[arg-type]  # no tuples among them


def _times(times: Sequence[float] | NDArray[np.float64]) -> tuple[float, ...]:
    try:
        seconds = tuple(float(time) for time in times)
    except (TypeError, ValueError) as error:
        raise ConfigurationError('--times', f'{times!r}', 'give numbers of seconds') from error
    steps = itertools.pairwise(seconds)
    if (
        not seconds
        or not all(math.isfinite(second) and second >= 0.0 for second in seconds)
        or not all(later > earlier for earlier, later in steps)
    ):
        raise ConfigurationError(
            '--times', f'{_listed(seconds)} [s]', 'give one or more, rising, none below 0'
        )
    return seconds


def _listed(values: Sequence[float]) -> str:
    ellipsis = ', ...' if len(values) > 6 else ''
    return (', '.join(f'{value:g}' for value in values[:6]) or 'no times') + ellipsis


def _trays(numbers: Iterable[Scalar]) -> tuple[Tray, ...]:
    flown = load_trays()
    return tuple(tray_by_number(flown, int(number)) for number in sorted(numbers))
