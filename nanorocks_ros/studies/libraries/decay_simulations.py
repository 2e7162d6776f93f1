"""Decay libraries from simulations: run in parallel, resumed, written to a file."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.decay.decay_library import NUISANCES, count_step, tray_key
from nanorocks_ros.inference.decay.decay_library_file import library_arrays
from nanorocks_ros.inference.decay.friction_terms import FRICTION, TANGENTIAL
from nanorocks_ros.inference.decay.library_fit import (
    Decays,
    distances,
    fewest_nodes,
    fewest_rough_nodes,
    fit_library,
    node_of,
)
from nanorocks_ros.jobs.resumed_tasks import fill_journal, resumed_journal
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.settings import SimulationSettings, with_values

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.decay_library import DecayLibrary
    from nanorocks_ros.jobs.journal import Journal
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.outputs.npz_archive import Arrays

# In space, [m/s]. Arbitrary without drag: then the decay is a function of speed times time alone.
MEAN_SPEED = 0.01
# The mean projected speed of a drawn start is within these factors of the expected one.
_SLOWER, _FASTER = 0.3, 3.0
_TIMES = 150
_DECAYS = 'log_speed'
_NODES_IN_TASK = 4
# Rough nodes have random numbers of their own.
_FIRST_ROUGH = 1 << 20
_LEAST_BEADS = 2
# Smallest speed over the first.
_REST = 1e-100


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryPlan:
    """Parameters of the simulations for a decay library.

    Parameters
    ----------
    tray : Tray
    nodes : int
        Number of points in the space of restitutions and nuisance parameters, with smooth beads.
    rough_nodes : int
        Further points, with beads that rub; 0: the library knows smooth beads alone.
    runs : int
        Runs at each node.
    seed : int
    drag : float, [1/s]
        As the setting of that name, at the mean speed of `MEAN_SPEED` at the start: what counts is
        the drag over the speed.
    """

    tray: Tray
    nodes: int
    runs: int
    rough_nodes: int = 0
    seed: int = 1
    drag: float = 0.0

    def specification(self) -> str:
        """Everything that the library depends on, as a JSON object."""
        return json.dumps(
            {
                'version': __version__,
                'nodes': self.nodes,
                'rough_nodes': self.rough_nodes,
                'runs': self.runs,
                'seed': self.seed,
                'tray': json.loads(tray_key(self.tray, self.drag)),
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Nodes:
    """A task: some nodes of a plan."""

    plan: LibraryPlan
    numbers: tuple[int, ...]
    rough: bool = False


def build_library(
    plan: LibraryPlan,
    output: Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
    notice: Callable[[str], None] | None = None,
) -> DecayLibrary:
    """Simulate the decays of a tray and write its library.

    Parameters
    ----------
    plan : LibraryPlan
    output : Path
        ``.npz``; finished nodes are kept in the folder ``OUTPUT.parts`` until it is written, so
        that the same call resumes an interrupted one.
    workers : Workers, optional
        By default processes on all cores.
    progress : callable, optional
        Called with the number of finished parts, of four nodes each, and the number of parts.
    notice : callable, optional
        Called with one line of text for each damaged part.

    Returns
    -------
    DecayLibrary

    Raises
    ------
    ConfigurationError, FitError
        For a plan that cannot be carried out.
    SimulationError
        When the beads do not fit.
    RecordingError
        When the output cannot be written, or its parts belong to another plan.
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    if plan.runs < 2 or plan.nodes < fewest_nodes():
        raise ConfigurationError(
            '--nodes, --runs',
            f'{plan.nodes}, {plan.runs}',
            f'give {fewest_nodes()} and 2 or more: fewer do not give an error estimate',
        )
    if 0 < plan.rough_nodes < fewest_rough_nodes():
        raise ConfigurationError(
            '--rough-nodes', f'{plan.rough_nodes}', f'give 0, or {fewest_rough_nodes()} or more'
        )
    if plan.tray.count < _LEAST_BEADS:
        raise ConfigurationError(
            f'tray {plan.tray.number}',
            f'has {counted(plan.tray.count, "bead")}; a gas whose decay can be compared has '
            f'{_LEAST_BEADS} or more',
            'use contacts alone, which need no library: nanorocks measure FILM',
        )
    # A drag out of range is refused before any work.
    _simulated(plan, 0)
    workers = workers or Workers()
    workers.check()
    with resumed_journal(output, plan.specification(), notice) as journal:
        fill_journal(journal, cool_nodes, _tasks(plan), workers, progress)
        library = fit_library(
            plan.tray,
            _decays(plan, journal),
            plan.specification(),
            plan.drag,
            _decays(plan, journal, rough=True) if plan.rough_nodes else None,
        )
        write_archive(output, library_arrays(library))
    return library


def _tasks(plan: LibraryPlan) -> dict[str, _Nodes]:
    return {
        _key(part, rough=rough): _Nodes(plan=plan, numbers=part, rough=rough)
        for rough in (False, True)
        for part in _parts(plan, rough=rough)
    }


def _parts(plan: LibraryPlan, *, rough: bool) -> list[tuple[int, ...]]:
    numbers = range(plan.rough_nodes if rough else plan.nodes)
    starts = range(0, len(numbers), _NODES_IN_TASK)
    return [tuple(numbers[first : first + _NODES_IN_TASK]) for first in starts]


def _key(numbers: tuple[int, ...], *, rough: bool) -> str:
    return f'{"rough-" if rough else ""}{numbers[0]}-{numbers[-1] + 1}'


def _decays(plan: LibraryPlan, journal: Journal, *, rough: bool = False) -> Decays:
    parts = _parts(plan, rough=rough)
    nodes = [node_of(number, rough=rough) for part in parts for number in part]

    def column(name: str) -> NDArray[np.float64]:
        return np.array([node[name] for node in nodes])

    return Decays(
        restitution=column('restitution'),
        wall_restitution=column('wall_restitution'),
        floor_lid_restitution=column('floor_lid_restitution'),
        nuisances=np.column_stack([column(name) for name in NUISANCES]),
        friction=np.column_stack([column(name) for name in FRICTION]),
        log_speed=np.concatenate(
            [journal.read(_key(part, rough=rough))[_DECAYS] for part in parts]
        ),
    )


def cool_nodes(task: _Nodes) -> Arrays:
    """The decays of some nodes: ``log_speed`` (n_nodes, n_runs, n_x)."""
    nodes = [cool_node(task.plan, number, rough=task.rough) for number in task.numbers]
    return {_DECAYS: np.stack(nodes)}


def cool_node(plan: LibraryPlan, number: int, *, rough: bool = False) -> NDArray[np.float64]:
    """Decays of the runs at one node, ln f, (n_runs, n_x).

    Parameters
    ----------
    plan : LibraryPlan
    number : int
        Of the node.
    rough : bool
        Whether it is one of the rough ones.

    Raises
    ------
    SimulationError
        When the beads do not fit, or a run has events without end.
    """
    from nanorocks_ros.simulation.ensemble import cooling_runs

    x = distances()
    times = np.geomspace(x[0] / (_FASTER * MEAN_SPEED), x[-1] / (_SLOWER * MEAN_SPEED), _TIMES)
    settings, tray = _simulated(plan, number, rough=rough)
    first = number + (_FIRST_ROUGH if rough else 0)
    runs = [(first << 32) + run for run in range(plan.runs)]
    speed = cooling_runs(settings, tray, np.concatenate(([0.0], times)), runs).mean_projected_speed
    start = speed[:, :1]
    # Beads that rub may come to rest, in the end of all digits.
    speed = np.maximum(speed, _REST * start)
    return np.array(
        [
            np.interp(np.log(x), np.log(times * first[0]), np.log(curve[1:] / first[0]))
            for curve, first in zip(speed, start, strict=True)
        ]
    )


def _simulated(
    plan: LibraryPlan, number: int, *, rough: bool = False
) -> tuple[SimulationSettings, Tray]:
    """Settings and tray of a node."""
    node = node_of(number, rough=rough)
    tray = plan.tray
    index = max(range(len(tray.species)), key=lambda k: tray.species[k].count)
    most_frequent = tray.species[index]
    size = 1.0 + node['diameter']
    species = list(tray.species)
    species[index] = replace(
        most_frequent,
        diameter_low=size * most_frequent.diameter_low,
        diameter_high=size * most_frequent.diameter_high,
        count=max(1, most_frequent.count + round(node['count']) * count_step(tray)),
    )
    length, width, height = tray.dimensions
    wall, ends = node['wall_restitution'], node['floor_lid_restitution']
    values = {
        'seed': plan.seed,
        'restitution': node['restitution'],
        'wall_restitution': wall,
        'floor_lid_difference': ends - wall,
        'vertical_speed_factor': math.exp(node['anisotropy']),
        'speeds': 'maxwellian' if node['start'] > 0.0 else 'uniform',
        'mean_speed': MEAN_SPEED,
        'drag': plan.drag,
    }
    if rough:
        tangential = TANGENTIAL + node['tangential']
        friction = node['wall_friction']
        values |= {
            'tangential_restitution': tangential,
            'wall_tangential_restitution': tangential,
            'wall_friction': friction,
            'friction': friction * math.exp(node['bead_friction']),
        }
    return (
        with_values(SimulationSettings(), values, 'decay library'),
        replace(tray, species=tuple(species), dimensions=(length, width, height + node['height'])),
    )
