"""Cluster curves from simulated films: run in parallel, resumed, written to a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.inference.cluster_size.cluster_curve import as_arrays, load_curves
from nanorocks_ros.jobs.resumed_tasks import fill_journal, resumed_journal
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.studies.libraries.cluster_films import ClusterPlan, samples_of_run

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from nanorocks_ros.inference.cluster_size.size_from_width import ClusterCurve
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.outputs.npz_archive import Arrays

_SAMPLES = 'samples'
_MIN_RUNS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """A task: one run of a plan."""

    plan: ClusterPlan
    run: int


def build_curves(
    plan: ClusterPlan,
    output: Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
    notice: Callable[[str], None] | None = None,
) -> Mapping[str, ClusterCurve]:
    """Film growing clusters, and write the cluster curves of their trays.

    Parameters
    ----------
    plan : ClusterPlan
    output : Path
        ``.npz``; finished runs are kept in the folder ``OUTPUT.parts`` until it is written, so
        that the same call resumes an interrupted one.
    workers : Workers, optional
        By default processes on all cores.
    progress : callable, optional
        Called with the number of finished runs and the number of runs.
    notice : callable, optional
        Called with one line of text for each damaged part.

    Returns
    -------
    mapping of str to ClusterCurve
        By `curve_key` of the tray.

    Raises
    ------
    ConfigurationError
        For a plan that cannot be carried out.
    SimulationError
        When the beads do not fit.
    RecordingError
        When the output cannot be written, or its parts belong to another plan.
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    if plan.runs < _MIN_RUNS:
        raise ConfigurationError(
            '--runs', f'{plan.runs}', f'give {_MIN_RUNS} or more: each has one sticking speed'
        )
    workers = workers or Workers()
    workers.check()
    with resumed_journal(output, plan.specification(), notice) as journal:
        tasks = {str(run): _Run(plan=plan, run=run) for run in range(plan.runs)}
        fill_journal(journal, film_run, tasks, workers, progress)
        samples = [journal.read(str(run))[_SAMPLES] for run in range(plan.runs)]
        trays = {number: plan.cells[number] for number in plan.trays}
        arrays = as_arrays(trays, plan.level, np.concatenate(samples), plan.specification())
        write_archive(output, arrays)
    load_curves.cache_clear()
    return load_curves(str(output), packaged=False)


def film_run(task: _Run) -> Arrays:
    """The samples of one run."""
    return {_SAMPLES: samples_of_run(task.plan, task.run)}
