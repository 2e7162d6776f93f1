"""Simulation of one shaking event of a tray in several runs."""

from __future__ import annotations

import math
import time
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.experiment.materials import known_materials
from nanorocks_ros.experiment.trays import Species, Tray
from nanorocks_ros.jobs.tasks import Workers, as_completed
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.event_counts import EventCounts
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.kernel_choice import MOST_FOR_SCAN
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRun, SimulatedRuns

if TYPE_CHECKING:
    from collections.abc import Callable

    from nanorocks_ros.simulation.engine.run_record import RunRecord

# Less work than this is done sooner in this process than with others [s].
_MIN_SECONDS_FOR_PROCESSES = 3.0
# With more beads the first run is not done here alone, since it occupies one core for long.
_MAX_BEADS_FOR_TRIAL = 2000
# Enough tasks for each process that none waits long for the last one.
_TASKS_PER_PROCESS = 8


def simulate(
    plan: SimulationPlan,
    workers: Workers,
    progress: Callable[[float], None] | None = None,
) -> SimulatedRuns:
    """Simulate the cooling of a tray after a shaking event.

    The numbers do not depend on the workers: each run has its own random numbers. Short
    simulations run in this process.

    Parameters
    ----------
    plan : SimulationPlan
    workers : Workers
    progress : callable, optional
        Called with the finished fraction of the work, 0 to 1.

    Raises
    ------
    ConfigurationError
        For more values than memory may hold.
    SimulationError
        When the beads do not fit, a run has events without end, or keeps more than `MAX_EVENTS`
        events.
    NanorocksError
        When workers die repeatedly.
    """
    plan.check_size()
    report = progress or (lambda done: None)
    # Before other processes start: without compiled code on disk each would compile it.
    load_compiled_code()
    report(0.0)
    runs: list[SimulatedRun] = []
    if plan.runs == 1 or plan.tray.count <= _MAX_BEADS_FOR_TRIAL:
        start = time.perf_counter()
        runs.append(_simulated_run(plan, 0, lambda part: report(part / plan.runs)))
        plan.check_events(len(runs[0].events) * plan.runs)
        if (time.perf_counter() - start) * (plan.runs - 1) < _MIN_SECONDS_FOR_PROCESSES:
            workers = replace(workers, processes=1)
    with closing(as_completed(_run_task, _tasks(plan, len(runs), workers), workers)) as results:
        for _, finished_runs in results:
            runs.extend(finished_runs)
            report(len(runs) / plan.runs)
            plan.check_events(sum(len(run.events) for run in runs))
    report(1.0)
    return SimulatedRuns(plan=plan, runs=tuple(sorted(runs, key=lambda run: run.number)))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    plan: SimulationPlan
    first: int
    last: int


def _tasks(plan: SimulationPlan, done: int, workers: Workers) -> dict[str, _Task]:
    """Tasks with the remaining runs."""
    size = math.ceil((plan.runs - done) / (workers.count * _TASKS_PER_PROCESS))
    if workers.count == 1:
        size = 1
    return {
        f'{first}': _Task(plan=plan, first=first, last=min(first + size, plan.runs))
        for first in range(done, plan.runs, max(size, 1))
    }


def _run_task(task: _Task) -> tuple[SimulatedRun, ...]:
    load_compiled_code()
    return tuple(_simulated_run(task.plan, run) for run in range(task.first, task.last))


def _simulated_run(
    plan: SimulationPlan, run: int, progress: Callable[[float], None] | None = None
) -> SimulatedRun:
    """Simulate one run from the shaking event on."""
    start = time.thread_time()
    rules = rules_of(plan.settings, plan.tray, run)
    resting = resting_beads(plan.settings, plan.tray, run)
    gas = HardSphereGas(after_shaking(plan.settings, rules, resting, run, 0), rules)

    def report_time(now: float) -> None:
        if plan.events:
            plan.check_events(_event_count(gas.counts))
        if progress is not None:
            progress(now / plan.duration)

    times = plan.times
    kept = times[plan.bead_times(run)]
    course = gas.follow(plan.duration, kept, times, log=plan.events, progress=report_time)
    return _run_record(gas, course, run, time.thread_time() - start)


def _run_record(gas: HardSphereGas, course: RunRecord, run: int, seconds: float) -> SimulatedRun:
    n_times, n = course.positions.shape[:2]
    alone = np.broadcast_to(np.arange(n, dtype=np.int32), (n_times, n))
    return SimulatedRun(
        number=run,
        mean_speed=course.observations.mean_speed,
        mean_projected_speed=course.observations.mean_projected_speed,
        bodies=course.observations.bodies,
        counts=gas.counts,
        cpu_seconds=seconds,
        radii=gas.radii,
        masses=gas.masses,
        drag=gas.drag,
        positions=course.positions,
        velocities=course.velocities,
        spins=course.spins,
        body=alone if course.bodies is None else course.bodies,
        events=course.events,
    )


def _event_count(counts: EventCounts) -> int:
    return counts.pair + counts.wall + counts.merge + counts.fix


@cache
def load_compiled_code() -> None:
    """Load the compiled code, which takes a second in each process."""
    settings = SimulationSettings()
    for count in (2, MOST_FOR_SCAN + 1):
        material = known_materials()['acrylic']
        species = Species(properties=material, diameter_low=1e-3, diameter_high=1e-3, count=count)
        tray = Tray(number=1, dimensions=(0.02, 0.02, 0.02), species=(species,), chalk=False)
        plan = SimulationPlan(settings=settings, tray=tray, duration=0.1, samples=2, events=True)
        _simulated_run(plan, 0)
