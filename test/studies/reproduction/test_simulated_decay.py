"""The deviation of simulated runs from a measured decay."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
from nanorocks_ros.studies.reproduction.chapters.simulation_chapter import decay_deviation
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_runs import simulate


@pytest.fixture(scope='module')
def runs():
    plan = SimulationPlan(
        settings=SimulationSettings(tray=1, restitution=0.89, wall_restitution=0.97, seed=3),
        tray=load_trays()[1],
        duration=10.0,
        samples=51,
        runs=30,
    )
    return simulate(plan, Workers(processes=1))


def measured(runs, factor, cycles):
    speed = factor * runs.mean('mean_projected_speed')
    return SpeedCurve(times=runs.plan.times, speed=speed, error=0.0 * speed, cycles=cycles)


def test_the_mean_itself_does_not_deviate(runs):
    assert decay_deviation(runs, measured(runs, 1.0, 5)) == pytest.approx(0.0, abs=1e-20)


def test_a_difference_is_in_units_of_the_errors_of_both_means(runs):
    chi_square, relative = decay_deviation(runs, measured(runs, 1.1, 5))[:, 10:]
    assert relative == pytest.approx((0.1 / 1.1) ** 2)
    curves = np.array([run.mean_projected_speed for run in runs.runs])[:, 10:]
    variance = curves.var(axis=0, ddof=1) * (1 / 30 + 1 / 5)
    assert chi_square == pytest.approx((0.1 * curves.mean(axis=0)) ** 2 / variance)


def test_single_runs_deviate_by_about_one(runs):
    curves = [run.mean_projected_speed for run in runs.runs]
    deviations = [
        decay_deviation(
            runs, SpeedCurve(times=runs.plan.times, speed=curve, error=0.0 * curve, cycles=1)
        )[0].mean()
        for curve in curves
    ]
    assert np.mean(deviations) == pytest.approx(1.0, abs=0.1)
