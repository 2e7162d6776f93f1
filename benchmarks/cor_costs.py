"""Costs of restitutions: a fit, a node of a library, a search of the size in the paper."""

from __future__ import annotations

from time import process_time
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import PipelineSettings, SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.stages.contacts.cycle_contacts import CycleContacts
from nanorocks_ros.stages.restitution.decay_library_method import DecayLibraryMethod
from nanorocks_ros.stages.restitution.restitution_method import Decay
from nanorocks_ros.studies.libraries.library_nodes import LibraryPlan, cool_node
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

if TYPE_CHECKING:
    from collections.abc import Callable

_TIMES = np.arange(1.75, 20.0, 0.25)
_ERROR = 0.02
_REPEATS = 50
# Nodes measured, and runs and seed of the library of tray 1.
_NODES, _RUNS_OF_NODE, _SEED = 40, 24, 1
# Search of the paper: points along each axis and runs at each point; and the measured part.
_POINTS, _RUNS = 40, 178
_SOME_POINTS, _SOME_RUNS = 10, 40


def print_costs() -> None:
    """Print the costs; times of one machine, for ratios."""
    fit, law = _fits()
    print(f"one update: {1e3 * fit:.1f} ms of CPU, {fit / law:.1f} fits of Haff's law")
    node = _library_node()
    print(
        f'one node of the library of tray 1, {_RUNS_OF_NODE} runs: {1e3 * node:.0f} ms of CPU '
        f'(mean of {_NODES}), {node / fit:.1f} updates'
    )
    part = _search()
    share = _SOME_POINTS**2 * _SOME_RUNS / (_POINTS**2 * _RUNS)
    print(
        f'search of {_POINTS} x {_POINTS} points with {_RUNS} runs each, tray 1: '
        f'{part / share / 60.0:.1f} min of CPU, half of that on two free cores; extrapolated from '
        f'{_SOME_POINTS} x {_SOME_POINTS} points with {_SOME_RUNS} runs each '
        f'({100.0 * share:.1f} % of it) in {part:.1f} s'
    )


def _cost(work: Callable[[], object], repeats: int) -> float:
    """CPU time of one call after compilation, [s]."""
    work()
    start = process_time()
    for _ in range(repeats):
        work()
    return (process_time() - start) / repeats


def _fits() -> tuple[float, float]:
    """CPU times of one live update and of a fit of Haff's law to the same speeds, [s]."""
    tray = load_trays()[1]
    settings = SimulationSettings(
        restitution=0.89, wall_restitution=0.97, seed=4242, mean_speed=0.01
    )
    (speed,) = cooling_runs(settings, tray, _TIMES, [0]).mean_projected_speed
    decay = Decay(time=_TIMES, speed=speed, error=_ERROR * speed)
    pipeline = PipelineSettings()
    method, none = DecayLibraryMethod(pipeline, tray), CycleContacts(pipeline.cooling)
    return (
        _cost(lambda: method.estimate(decay, none, final=False), _REPEATS),
        _cost(lambda: fit_haff(_TIMES, speed, _ERROR * speed, tray.count), _REPEATS),
    )


def _library_node() -> float:
    plan = LibraryPlan(tray=load_trays()[1], nodes=_NODES, runs=_RUNS_OF_NODE, seed=_SEED)
    cool_node(plan, 0)
    start = process_time()
    for number in range(_NODES):
        cool_node(plan, number)
    return (process_time() - start) / _NODES


def _search() -> float:
    """CPU time of a part of the search, spread evenly over the grid, [s]."""
    plan = sweep_plan(
        SimulationSettings(tray=1, seed=1, mean_speed=0.01),
        {
            'restitution': np.linspace(0.5, 1.0, _SOME_POINTS).tolist(),
            'wall_restitution': np.linspace(0.8, 1.0, _SOME_POINTS).tolist(),
        },
        _TIMES,
        _SOME_RUNS,
    )
    return _cost(lambda: sweep(plan, workers=Workers(processes=1)), 1)
