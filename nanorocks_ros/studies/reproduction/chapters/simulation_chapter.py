"""Chapter on the simulation that the paper compares with its films: Figure 11.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import BLACK, FITTED, PURPLE, SKY, TWO_COLUMNS
from nanorocks_ros.outputs.html_report import Picture, Section, Table, number
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.decays.cooling_curves import mean_cycle, read_cycles, speed_table
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_runs import simulate

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context
    from nanorocks_ros.studies.synthetic.simulated_result import SimulatedRuns

_TRAY = 1
_DURATION, _SAMPLES = 30.0, 301
_MM = 1e3
_RUN, _MEAN, _MEASURED, _CHI = SKY, FITTED, BLACK, PURPLE


class SimulatedDecay(NamedTuple):
    """Simulated runs and their deviation from the measured decay.

    `restitutions`: of beads and walls; `deviation`: at the times of the measured decay, chi
    square and squared relative difference, (2, n).
    """

    restitutions: tuple[float, float]
    runs: SimulatedRuns
    deviation: NDArray[np.float64]


def simulation_chapter(context: Context) -> Chapter:
    """Figure 11."""
    measured = _measured(context)
    known = context.plan.restitution, context.plan.wall_restitution
    of_paper = reported.PAPER_RESTITUTION, reported.PAPER_WALL_RESTITUTION
    decays = []
    for k, restitutions in enumerate((of_paper, known)):
        runs = _simulated(context, restitutions, k)
        deviation = decay_deviation(runs, measured)
        decays.append(SimulatedDecay(restitutions, runs, deviation))
    path = context.picture('simulated.png')
    _draw(path, decays[0], measured)
    rows = [
        (f'beads {beads:g}, walls {walls:g} ({name})', *(number(mean, 2) for mean in means))
        for (beads, walls), name, means in (
            (decay.restitutions, name, decay.deviation.mean(axis=1))
            for decay, name in zip(
                decays,
                ('a best match of the paper in flight', 'the truth of the films'),
                strict=True,
            )
        )
    ]
    section = Section(
        title='The simulation (Figure 11)',
        parts=[
            f'{reported.PAPER_RUNS} simulated runs of tray 1 with the restitutions that the paper '
            'found, 0.89 between beads and 0.99 at walls. As in the paper beads are hard spheres '
            'that move from event to event in three dimensions, start with speeds uniform from 0 '
            'to twice the mean in random directions, and are seen in projection. Other than in '
            'the paper nothing sticks here: the sticking threshold of its runs is not given.',
            Picture(
                path=path,
                caption='Figure 11: runs, their mean, and the mean decay measured on our films '
                'without sticking, in projection; below, chi square of both means.',
            ),
            Table(
                head=('simulated', 'chi square', 'squared relative difference'),
                rows=rows,
                caption='Deviation of the simulated from the measured mean decay, mean over its '
                'times. Chi square in units of the squared errors of both, with the scatter of '
                'the gas from run to run: about 1 for agreement, but a gas that is slow by '
                'chance stays slow, so that a mean of few cycles is often far from 1. The '
                f'paper prints {reported.PAPER_CHI_SQUARE:g} for its best match and '
                'defines no units, so the two cannot be compared.',
            ),
        ],
    )
    return Chapter(section=section)


def _measured(context: Context) -> SpeedCurve:
    cycles = [
        cycle
        for files in context.bouncing
        for cycle in read_cycles(speed_table(files.results, _TRAY)[0])
    ]
    return mean_cycle(cycles, 0.0, _DURATION)


def _simulated(context: Context, restitutions: tuple[float, float], k: int) -> SimulatedRuns:
    settings = SimulationSettings(
        tray=_TRAY,
        restitution=restitutions[0],
        wall_restitution=restitutions[1],
        mean_speed=context.plan.mean_speed,
        seed=context.plan.seed,
    )
    plan = SimulationPlan(
        settings=settings,
        tray=load_trays()[_TRAY],
        duration=_DURATION,
        samples=_SAMPLES,
        runs=reported.PAPER_RUNS,
    )
    return simulate(plan, context.workers, lambda done: context.progress(0.5 * (k + done)))


def decay_deviation(runs: SimulatedRuns, measured: SpeedCurve) -> NDArray[np.float64]:
    """Deviation of the mean of simulated runs from a measured mean decay.

    Parameters
    ----------
    runs : SimulatedRuns
        Two or more runs.
    measured : SpeedCurve
        The mean of `cycles` measured decays, over times that the runs cover.

    Returns
    -------
    ndarray (2, n)
        At the times of the decay: chi square, with the scatter of the runs for both means, and
        the squared difference over the squared measured speed.
    """
    curves = np.array([run.mean_projected_speed for run in runs.runs])
    times = runs.plan.times
    mean = np.interp(measured.times, times, curves.mean(axis=0))
    scatter = np.interp(measured.times, times, curves.std(axis=0, ddof=1))
    variance = scatter**2 * (1.0 / len(curves) + 1.0 / (measured.cycles or 1)) + measured.error**2
    squares = (mean - measured.speed) ** 2
    return np.array([squares / variance, squares / measured.speed**2])


def _draw(path: Path, decay: SimulatedDecay, measured: SpeedCurve) -> None:
    times = decay.runs.plan.times
    with figure_file(path, TWO_COLUMNS, 115.0) as figure:
        axes: Any
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        curves = [
            np.column_stack((times, _MM * run.mean_projected_speed)) for run in decay.runs.runs
        ]
        axes.add_collection(
            LineCollection(curves, colors=_RUN, linewidths=0.5, label=f'{len(curves)} runs')
        )
        mean = decay.runs.mean('mean_projected_speed')
        axes.plot(times, _MM * mean, color=_MEAN, lw=2, label='their mean')
        low, high = (_MM * (measured.speed + sign * measured.error) for sign in (-1.0, 1.0))
        axes.fill_between(measured.times, low, high, color=_MEASURED, alpha=0.25, lw=0)
        axes.plot(measured.times, _MM * measured.speed, color=_MEASURED, lw=1.5,
                  label='measured on our films')  # fmt: skip
        axes.set(xlim=(0.0, times[-1]), ylim=(0.0, None), ylabel='mean projected speed [mm/s]')
        beads, walls = decay.restitutions
        axes.set_title(f'tray {_TRAY}, beads {beads:g}, walls {walls:g}')
        axes.legend()
        below.plot(measured.times, decay.deviation[0], color=_CHI, lw=1.2)
        below.axhline(1.0, color='0.5', lw=1)
        below.set(xlabel='time since the shaking event [s]', ylabel='chi square', ylim=(0.0, None))
        for panel in (axes, below):
            panel.grid(alpha=0.25)
