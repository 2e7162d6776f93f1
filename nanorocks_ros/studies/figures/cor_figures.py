"""The figures of the paper that determine the restitutions of one tray, in one folder.

The decay with its fits (figure 7), the maps of the search over simulated runs (figure 12), and the
restitution against speed (figure 13).

Tested by ``test/cli/figures/test_figure_cor.py``.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.cooling_age import cooling_age
from nanorocks_ros.outputs.unfinished_files import holds_files
from nanorocks_ros.settings import PriorSettings, SimulationSettings, with_values
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
# Length of the sweep over that of the decay, for decays with a higher initial speed.
_DURATION_FACTOR = 1.5
_TIMES = 31
_ROUNDING = 1e-12
# Mean projected speed over mean speed of an isotropic gas.
_PROJECTED = 0.25 * math.pi


@dataclass(frozen=True, slots=True, kw_only=True)
class CorData:
    """Measured cycles of one tray.

    Parameters
    ----------
    tray : Tray
        A tray as flown; sweeps simulate no other.
    cycles : tuple of CycleSpeeds
    species : tuple of tuples of CycleSpeeds
        The cycles of each species; empty where species were not separated.
    span : tuple of 2 floats, [s]
        First and last time of the fit, since the shaking event.
    start : float, [s]
        Start of the cooling, since the shaking event.
    wall_restitution : float, 0 to 1
        Restitution of the walls in figures that do not vary it.
    published : tuple of str, optional
        Lines about what the analysis published, which stand first.
    """

    tray: Tray
    cycles: tuple[CycleSpeeds, ...]
    species: tuple[tuple[CycleSpeeds, ...], ...]
    span: tuple[float, float]
    start: float
    wall_restitution: float
    published: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """The grids of the search.

    Parameters
    ----------
    beads, walls, widths : tuple of float, 0 to 1
        Restitutions between beads, restitutions at walls, and full widths of a uniform
        distribution of the former; two or more each.
    runs : int, > 0
        Simulated runs at each point.
    seed : int
    """

    beads: tuple[float, ...]
    walls: tuple[float, ...]
    widths: tuple[float, ...]
    runs: int = 20
    seed: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Reports:
    """Callbacks for progress and messages.

    Parameters
    ----------
    progress : callable
        Called with the name of the map, the runs done and all runs.
    notice : callable
        Called with messages for the user, one line each.
    """

    progress: Callable[[str, int, int], None]
    notice: Callable[[str], None]


def prepare_folder(folder: Path) -> None:
    """Make the folder, or reuse that of an earlier call.

    Raises
    ------
    RecordingError
        When it holds other files, or cannot be made or written.
    """
    if folder.exists() and not (folder / _MARK).is_file() and holds_files(folder):
        raise RecordingError(
            str(folder), 'exists and holds no figures of this command', 'pass another --output'
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
    """Draw all figures; runs of the search are kept in the folder and reused.

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
        ``decay``; ``walls`` and ``width`` (values along both axes, chi square, best point);
        ``instantaneous`` (InstantaneousCor, or None where it cannot be determined).

    Raises
    ------
    ConfigurationError
        For a tray that was not flown, or an invalid search.
    FitError, RecordingError
        When the speeds are no decay.
    KeyboardInterrupt
        On Ctrl-C; the text names the runs that are kept.
    """
    if load_trays().get(data.tray.number) != data.tray:
        raise ConfigurationError(
            f'tray {data.tray.number}',
            'differs from the tray as flown',
            'use `nanorocks figure decay`',
        )
    curve = mean_cycle(data.cycles, *data.span)
    check_errors(curve)
    plans = search_plans(search, data, curve)
    for axes in (plan.axes for plan in plans.values()):
        check_drawable(folder / WALLS, axes)
    common: dict[str, Any] = {'wall_restitution': data.wall_restitution, 'span': data.span}
    values: dict[str, Any] = {
        'decay': decay_figure(
            folder / DECAY,
            data.tray,
            data.cycles,
            **common,
            species=data.species,
            start=data.start,
            published=data.published,
        ),
        'instantaneous': _instantaneous(folder / SPEED, data, reports),
    }
    cycles, span = cooling_part(data.cycles, data.span, _began(data))
    cooling = mean_cycle(cycles, *span)
    for name, plan in plans.items():
        values[name] = _map(folder, name, plan, cooling, workers, reports)
    return values


def search_plans(search: Search, data: CorData, curve: SpeedCurve) -> dict[str, SweepPlan]:
    """The two sweeps behind the maps of the paper's figure 12.

    Their beads start with the initial speed of the decay, rounded to two digits.

    Raises
    ------
    ConfigurationError
        For invalid values.
    """
    lowest = PriorSettings().min_wall_restitution
    searched = max(min(search.walls), lowest), max(*search.walls, lowest)
    mean_speed = float(f'{_initial_speed(data, curve, searched) / _PROJECTED:.2g}')
    settings = with_values(
        SimulationSettings(),
        {'tray': data.tray.number, 'seed': search.seed, 'mean_speed': mean_speed},
        'search',
    )
    last = float(f'{_DURATION_FACTOR * (data.span[1] - _began(data)):.6g}')
    times = [last * k / (_TIMES - 1) for k in range(_TIMES)]
    walls = {'restitution': search.beads, 'wall_restitution': search.walls}
    # Made first, since it checks the restitutions.
    plans = {'walls': sweep_plan(settings, walls, times, search.runs, keep_runs=True)}
    half = 0.5 * max(search.widths, default=0.0)
    # No collision may gain energy.
    possible = [
        restitution
        for restitution in search.beads
        if half <= restitution <= 1.0 - half + _ROUNDING
    ]
    if len(possible) < 2:
        raise ConfigurationError(
            '--widths',
            f'up to {2.0 * half:g} leave {len(possible)} of --beads between 0 and 1',
            'give narrower widths',
        )
    fixed = with_values(settings, {'wall_restitution': data.wall_restitution}, 'search')
    widths = {'restitution': possible, 'restitution_width': search.widths}
    return {**plans, 'width': sweep_plan(fixed, widths, times, search.runs, keep_runs=True)}


def _began(data: CorData) -> float:
    """When a gas at rest would have begun to cool, since the shaking event, [s]."""
    return data.start - cooling_age(data.start).value


def _initial_speed(data: CorData, curve: SpeedCurve, walls: tuple[float, float]) -> float:
    """Approximate mean projected speed at the start of the cooling, [m/s], for some walls."""
    try:
        return library_decay(data.tray, data.cycles, curve, data.start, walls).initial_speed
    except FitError:
        return float(curve.speed[0])


def _instantaneous(path: Path, data: CorData, reports: Reports) -> InstantaneousCor | None:
    cycles, span = cooling_part(data.cycles, data.span, data.start)
    try:
        return instantaneous_figure(
            path,
            data.tray,
            cycles,
            wall_restitution=data.wall_restitution,
            span=span,
            published=data.published,
        )
    except (ConfigurationError, FitError) as error:
        # The other figures can be drawn without it.
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
    """Run the sweep of one map, draw it, and return its values."""
    result = sweep(
        plan,
        folder / f'{name}_{plan.runs}_runs.npz',
        workers,
        lambda done, total: reports.progress(name, done, total),
        reports.notice,
    )
    chi_square_figure(folder / f'{name}.png', result, curve, scaled=True)
    values = chi_square(result, curve, scaled=True)
    best = np.unravel_index(int(values.argmin()), values.shape)
    return {
        **{axis.name: list(axis.values) for axis in plan.axes},
        'chi_square': values.tolist(),
        'best': {axis.name: axis.values[int(k)] for axis, k in zip(plan.axes, best, strict=True)},
        'runs': plan.runs,
    }
