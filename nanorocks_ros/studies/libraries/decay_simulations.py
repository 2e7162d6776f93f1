"""Decay libraries from simulations: run in parallel, resumed, written to a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.decay.decay_library import NUISANCES
from nanorocks_ros.inference.decay.decay_library_file import library_arrays
from nanorocks_ros.inference.decay.friction_terms import FRICTION
from nanorocks_ros.inference.decay.library_fit import (
    Decays,
    fewest_nodes,
    fewest_rough_nodes,
    fit_library,
    node_of,
)
from nanorocks_ros.jobs.resumed_tasks import fill_journal, resumed_journal
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.simulation.initial_state import rules_of
from nanorocks_ros.studies.libraries.library_nodes import (
    LibraryPlan,
    cool_node,
    simulated_node,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.inference.decay.decay_library import DecayLibrary
    from nanorocks_ros.jobs.journal import Journal
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.outputs.npz_archive import Arrays

_DECAYS = 'log_speed'
_NODES_IN_TASK = 4
_LEAST_BEADS = 2


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
    # A drag or a law out of range is refused before any work.
    rules_of(*simulated_node(plan, 0))
    workers = workers or Workers()
    workers.check()
    with resumed_journal(output, plan.specification(), notice) as journal:
        fill_journal(journal, cool_nodes, _tasks(plan), workers, progress)
        library = fit_library(
            plan.tray,
            _decays(plan, journal),
            plan.specification(),
            plan.conditions,
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
