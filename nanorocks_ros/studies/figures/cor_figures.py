"""The figures by which the paper gets at restitutions, of one tray, in one folder.

The decay with its fits (figure 7), the maps of the search over simulated runs (figure 12), and the
restitution against speed (figure 13).
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.studies.decays.best_fit_decay import library_decay
from nanorocks_ros.studies.decays.chi_square_map import chi_square
from nanorocks_ros.studies.decays.cooling_curves import check_errors, cooling_part, mean_cycle
from nanorocks_ros.studies.figures.decay_figure import decay_figure
from nanorocks_ros.studies.figures.instantaneous_figure import instantaneous_figure
from nanorocks_ros.studies.figures.sweep_figure import check_drawable, chi_square_figure
from nanorocks_ros.studies.sweeps.sweep_plan import SweepPlan, sweep_plan
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.instantaneous_restitution import InstantaneousCor
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve

_MARK = '.nanorocks_cor_figures'
DECAY, WALLS, WIDTH, SPEED = 'decay.png', 'walls.png', 'width.png', 'cor_against_speed.png'
# The search leaves its last third to decays that started faster.
_LONGER = 1.5
_TIMES = 31
_ROUNDING = 1e-12
# Of the mean in three dimensions, that in the picture.
_PROJECTED = 0.25 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class CorData:
    """What was measured in one tray.

    Parameters
    ----------
    tray : Tray
        One that was flown: others cannot be searched.
    cycles : tuple of CycleSpeeds
    species : tuple of tuples of CycleSpeeds
        Of each species; empty where they were not told apart.
    span : tuple of 2 floats, [s]
        First and last time since the shaking event that is used.
    start : float, [s]
        From when on the gas cools, since the shaking event.
    wall_restitution : float, 0 to 1
        Where a figure needs it to be known.
    """

    tray: Tray
    cycles: tuple[CycleSpeeds, ...]
    species: tuple[tuple[CycleSpeeds, ...], ...]
    span: tuple[float, float]
    start: float
    wall_restitution: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """What to search.

    Parameters
    ----------
    beads, walls, widths : tuple of float, 0 to 1
        Restitutions between beads, at walls, and full widths of an even distribution of the
        former; two or more each.
    runs : int, > 0
        At every point.
    seed : int
    """

    beads: tuple[float, ...]
    walls: tuple[float, ...]
    widths: tuple[float, ...]
    runs: int = 20
    seed: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Reports:
    """Where to say how it goes.

    Parameters
    ----------
    progress : callable
        Called with the name of the map, and the runs done and the runs there are.
    notice : callable
        Called with what the user should know, one line each.
    """

    progress: Callable[[str, int, int], None]
    notice: Callable[[str], None]


def prepare_folder(folder: Path) -> None:
    """Make the folder, or take up the one an earlier call left.

    Raises
    ------
    RecordingError
        When it holds something else, or cannot be made or written.
    """
    if folder.exists() and not (folder / _MARK).is_file():
        raise RecordingError(
            str(folder), 'exists and holds no figures of ours', 'pass another --output'
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / _MARK).touch()
    except OSError as error:
        raise RecordingError(
            str(folder), f'cannot be written ({error.strerror})', 'pass another --output'
        ) from error
    if not os.access(folder, os.W_OK):
        raise RecordingError(str(folder), 'cannot be written to', 'pass another --output')


def cor_figures(
    folder: Path, data: CorData, search: Search, workers: Workers, reports: Reports
) -> dict[str, Any]:
    """Draw all figures; the runs of the search are kept in the folder and taken up again.

    Parameters
    ----------
    folder : Path
        From `prepare_folder`.
    data : CorData
    search : Search
    workers : Workers
    reports : Reports

    Returns
    -------
    dict
        What was found: ``decay``, ``walls`` and ``width`` (values along both axes, chi square,
        the best point), and ``instantaneous`` (InstantaneousCor, or None where it cannot be told).

    Raises
    ------
    ConfigurationError
        For a tray that was not flown, or a search that cannot be carried out.
    FitError, RecordingError
        When there is no decay.
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    if load_trays().get(data.tray.number) != data.tray:
        raise ConfigurationError(
            f'tray {data.tray.number}', 'is not as flown', 'use `nanorocks figure decay`'
        )
    curve = mean_cycle(data.cycles, *data.span)
    check_errors(curve)
    plans = search_plans(search, data, curve)
    for axes in (plan.axes for plan in plans.values()):
        check_drawable(folder / WALLS, axes)
    given: dict[str, Any] = {'wall_restitution': data.wall_restitution, 'span': data.span}
    found: dict[str, Any] = {
        'decay': decay_figure(
            folder / DECAY, data.tray, data.cycles, **given, species=data.species, start=data.start
        ),
        'instantaneous': _instantaneous(folder / SPEED, data, reports),
    }
    cycles, span = cooling_part(data.cycles, data.span, data.start)
    cooling = mean_cycle(cycles, *span)
    for name, plan in plans.items():
        found[name] = _map(folder, name, plan, cooling, workers, reports)
    return found


def search_plans(search: Search, data: CorData, curve: SpeedCurve) -> dict[str, SweepPlan]:
    """The two sweeps behind the maps of the paper's figure 12.

    Their beads start as fast as those of the decay did, as far as two digits tell.

    Raises
    ------
    ConfigurationError
        For values that cannot be used.
    """
    mean_speed = float(f'{_initial_speed(data, curve) / _PROJECTED:.2g}')
    settings = with_values(
        SimulationSettings(),
        {'tray': data.tray.number, 'seed': search.seed, 'mean_speed': mean_speed},
        'search',
    )
    last = float(f'{_LONGER * (data.span[1] - data.start):.6g}')
    times = [last * k / (_TIMES - 1) for k in range(_TIMES)]
    walls = {'restitution': search.beads, 'wall_restitution': search.walls}
    # First, as it checks the restitutions.
    plans = {'walls': sweep_plan(settings, walls, times, search.runs, keep_runs=True)}
    half = 0.5 * max(search.widths, default=0.0)
    # No single collision may gain energy.
    narrow = [one for one in search.beads if half <= one <= 1.0 - half + _ROUNDING]
    if len(narrow) < 2:
        raise ConfigurationError(
            '--widths',
            f'up to {2.0 * half:g} leave {len(narrow)} of --beads between 0 and 1',
            'give narrower widths',
        )
    known = with_values(settings, {'wall_restitution': data.wall_restitution}, 'search')
    widths = {'restitution': narrow, 'restitution_width': search.widths}
    return {**plans, 'width': sweep_plan(known, widths, times, search.runs, keep_runs=True)}


def _initial_speed(data: CorData, curve: SpeedCurve) -> float:
    """Mean projected speed when the gas began to cool, about."""
    try:
        return library_decay(data.tray, data.cycles, curve, data.start).initial_speed
    except FitError:
        return float(curve.speed[0])


def _instantaneous(path: Path, data: CorData, reports: Reports) -> InstantaneousCor | None:
    cycles, span = cooling_part(data.cycles, data.span, data.start)
    try:
        return instantaneous_figure(
            path, data.tray, cycles, wall_restitution=data.wall_restitution, span=span
        )
    except (ConfigurationError, FitError) as error:
        # The other figures do not need it.
        reports.notice(f'no {path.name}: {error}')
        path.unlink(missing_ok=True)
        return None


def _map(
    folder: Path,
    name: str,
    plan: SweepPlan,
    curve: SpeedCurve,
    workers: Workers,
    reports: Reports,
) -> dict[str, Any]:
    """Search, draw and read one map."""
    found = sweep(
        plan,
        folder / f'{name}_{plan.runs}_runs.npz',
        workers,
        lambda done, total: reports.progress(name, done, total),
        reports.notice,
    )
    chi_square_figure(folder / f'{name}.png', found, curve, scaled=True)
    values = chi_square(found, curve, scaled=True)
    best = np.unravel_index(int(values.argmin()), values.shape)
    return {
        **{axis.name: list(axis.values) for axis in plan.axes},
        'chi_square': values.tolist(),
        'best': {axis.name: axis.values[int(k)] for axis, k in zip(plan.axes, best, strict=True)},
        'runs': plan.runs,
    }
