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
from nanorocks_ros.inference.decay.library_fit import (
    Decays,
    distances,
    fewest_nodes,
    fit_library,
    node_of,
)
from nanorocks_ros.jobs.resumed_tasks import fill_journal, resumed_journal
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import write_archive
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


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryPlan:
    """Parameters of the simulations for a decay library.

    Parameters
    ----------
    tray : Tray
    nodes : int
        Number of points in the space of restitutions and nuisance parameters.
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
    seed: int = 1
    drag: float = 0.0

    def specification(self) -> str:
        """Everything that the library depends on, as a JSON object."""
        return json.dumps(
            {
                'version': __version__,
                'nodes': self.nodes,
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
    # A drag out of range is refused before any work.
    _simulated(plan, 0)
    workers = workers or Workers()
    workers.check()
    with resumed_journal(output, plan.specification(), notice) as journal:
        fill_journal(journal, cool_nodes, _tasks(plan), workers, progress)
        library = fit_library(plan.tray, _decays(plan, journal), plan.specification(), plan.drag)
        write_archive(output, library_arrays(library))
    return library


def _tasks(plan: LibraryPlan) -> dict[str, _Nodes]:
    numbers = range(plan.nodes)
    parts = (
        numbers[first : first + _NODES_IN_TASK] for first in range(0, plan.nodes, _NODES_IN_TASK)
    )
    return {f'{part[0]}-{part[-1] + 1}': _Nodes(plan=plan, numbers=tuple(part)) for part in parts}


def _decays(plan: LibraryPlan, journal: Journal) -> Decays:
    parts = sorted(journal.keys(), key=lambda key: int(key.split('-')[0]))
    nodes = [node_of(number) for number in range(plan.nodes)]

    def column(name: str) -> NDArray[np.float64]:
        return np.array([node[name] for node in nodes])

    return Decays(
        restitution=column('restitution'),
        wall_restitution=column('wall_restitution'),
        floor_lid_restitution=column('floor_lid_restitution'),
        nuisances=np.column_stack([column(name) for name in NUISANCES]),
        log_speed=np.concatenate([journal.read(key)[_DECAYS] for key in parts]),
    )


def cool_nodes(task: _Nodes) -> Arrays:
    """The decays of some nodes: ``log_speed`` (n_nodes, n_runs, n_x)."""
    return {_DECAYS: np.stack([cool_node(task.plan, number) for number in task.numbers])}


def cool_node(plan: LibraryPlan, number: int) -> NDArray[np.float64]:
    """Decays of the runs at one node, ln f, (n_runs, n_x).

    Raises
    ------
    SimulationError
        When the beads do not fit, or a run has events without end.
    """
    from nanorocks_ros.simulation.ensemble import cooling_runs

    x = distances()
    times = np.geomspace(x[0] / (_FASTER * MEAN_SPEED), x[-1] / (_SLOWER * MEAN_SPEED), _TIMES)
    settings, tray = _simulated(plan, number)
    runs = [(number << 32) + run for run in range(plan.runs)]
    speed = cooling_runs(settings, tray, np.concatenate(([0.0], times)), runs).mean_projected_speed
    start = speed[:, :1]
    return np.array(
        [
            np.interp(np.log(x), np.log(times * first[0]), np.log(curve[1:] / first[0]))
            for curve, first in zip(speed, start, strict=True)
        ]
    )


def _simulated(plan: LibraryPlan, number: int) -> tuple[SimulationSettings, Tray]:
    """Settings and tray of a node."""
    node = node_of(number)
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
    return (
        with_values(SimulationSettings(), values, 'decay library'),
        replace(tray, species=tuple(species), dimensions=(length, width, height + node['height'])),
    )
