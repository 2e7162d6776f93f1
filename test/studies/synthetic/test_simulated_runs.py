"""Runs of a simulated tray: the same gas as everywhere, whoever does the work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.synthetic import simulated_plan, simulated_runs
from nanorocks_ros.studies.synthetic.film_bag import START_NS, film_into_bag
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan, default_samples
from nanorocks_ros.studies.synthetic.simulated_runs import simulate
from nanorocks_ros.studies.synthetic.trajectory import write_trajectory

HERE = Workers(processes=1)


def plan_of(tray=1, duration=2.0, samples=11, runs=1, kept=(), **settings):
    return SimulationPlan(
        settings=replace(SimulationSettings(), tray=tray, **settings),
        tray=load_trays()[tray],
        duration=duration,
        samples=samples,
        runs=runs,
        **dict.fromkeys(kept, True),
    )


@pytest.mark.parametrize('tray', [1, 6])
def test_runs_are_bit_for_bit_those_of_the_ensemble(tray):
    plan = plan_of(tray, duration=1.0, runs=3, sticking_speed=0.001)
    simulated = simulate(plan, HERE)
    expected = cooling_runs(plan.settings, plan.tray, plan.times, range(3))
    for name in ('mean_speed', 'mean_projected_speed', 'bodies'):
        curves = np.array([getattr(run, name) for run in simulated.runs])
        np.testing.assert_array_equal(curves, getattr(expected, name))
    assert simulated.count('pair') == expected.pair_collisions.sum()
    assert simulated.events > simulated.count('pair') + expected.wall_collisions.sum()


def test_beads_move_as_the_curves_say():
    simulated = simulate(plan_of(3, runs=2, kept=['trajectory']), HERE)
    for run in simulated.runs:
        speeds = np.linalg.norm(run.velocities, axis=2)
        np.testing.assert_allclose(speeds.mean(axis=1), run.mean_speed, rtol=1e-12)
        assert (run.positions >= run.radii[:, np.newaxis] * (1.0 - 1e-9)).all()
    assert not np.array_equal(simulated.runs[0].positions, simulated.runs[1].positions)


def test_a_picture_needs_the_beads_of_one_run_only():
    simulated = simulate(plan_of(samples=101, runs=2, kept=['picture']), HERE)
    whole = simulate(plan_of(samples=101, kept=['trajectory']), HERE)
    shown = list(simulated_plan.shown_times(101))
    assert shown == [0, 5, 25, 100]
    np.testing.assert_array_equal(simulated.runs[0].positions, whole.runs[0].positions[shown])
    assert simulated.runs[1].positions.size == 0


def test_what_is_kept_changes_no_number():
    bare = simulate(plan_of(), HERE)
    full = simulate(plan_of(kept=['trajectory', 'events']), HERE)
    np.testing.assert_array_equal(bare.mean('mean_speed'), full.mean('mean_speed'))
    assert bare.events == full.events == len(full.runs[0].events)


def test_files_do_not_depend_on_the_workers(tmp_path, monkeypatch):
    monkeypatch.setattr(simulated_runs, '_MIN_SECONDS_FOR_PROCESSES', 0.0)
    plan = plan_of(duration=0.5, runs=5, kept=['trajectory'])
    contents = []
    for processes in (1, 2):
        path = tmp_path / f'{processes}.npz'
        write_trajectory(path, simulate(plan, Workers(processes=processes)))
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]


def test_the_film_shows_the_first_run(tmp_path):
    picture = {'width_px': 64, 'height_px': 64, 'pixels_per_metre': 4000.0}
    plan = plan_of(duration=1.0, samples=11, frame_rate=10.0, first_shake=0.0, **picture)
    film_into_bag(
        tmp_path / 'bag', plan.settings, duration=1.0, quality=50, progress=lambda *_: None
    )
    truth = BagFrames(tmp_path / 'bag').truth(START_NS)[1]
    speeds = [record.mean_speed for record in truth]
    expected = simulate(plan, HERE).mean('mean_speed')[: len(speeds)]
    np.testing.assert_allclose(speeds, expected, rtol=1e-6)


def test_the_speed_has_halved_when_it_has():
    runs = simulate(plan_of(3, duration=20.0, samples=2001), HERE)
    speed = np.interp(runs.half_time, runs.plan.times, runs.mean('mean_speed'))
    assert speed == pytest.approx(runs.mean('mean_speed')[0] / 2.0, rel=1e-3)
    assert simulate(plan_of(duration=0.1), HERE).half_time is None
    assert simulate(plan_of(mean_speed=0.0), HERE).half_time is None


def test_one_run_has_no_error_and_several_have():
    assert simulate(plan_of(), HERE).error('mean_speed') is None
    simulated = simulate(plan_of(runs=4), HERE)
    curves = np.array([run.mean_speed for run in simulated.runs])
    expected = curves.std(axis=0, ddof=1) / 2.0
    np.testing.assert_allclose(simulated.error('mean_speed'), expected, rtol=1e-12)


def test_progress_rises_to_one():
    reported = []
    simulate(plan_of(duration=0.2, runs=3), HERE, reported.append)
    assert reported == sorted(reported)
    assert reported[-1] == 1.0


def test_more_numbers_than_memory_may_hold_are_refused():
    with pytest.raises(ConfigurationError, match='fewer --times or --runs, or no --trajectory'):
        simulate(plan_of(8, samples=301, runs=1000, kept=['trajectory']), HERE)
    plan_of(8, samples=301, runs=1000).check_size()


def test_more_events_than_memory_may_hold_are_refused(monkeypatch):
    monkeypatch.setattr(simulated_plan, 'MAX_EVENTS', 20)
    with pytest.raises(SimulationError, match=r'more than the 20 events.*shorter --duration'):
        simulate(plan_of(kept=['events']), HERE)
    simulate(plan_of(), HERE)


@pytest.mark.parametrize(
    ('wrong', 'flag'),
    [
        ({'runs': 0}, '--runs'),
        ({'samples': 1}, '--times'),
        ({'duration': 0.0}, '--duration'),
        ({'duration': float('nan')}, '--duration'),
        ({'restitution': 2.0}, 'restitution'),
    ],
)
def test_a_plan_that_cannot_be_is_refused(wrong, flag):
    with pytest.raises(ConfigurationError, match=flag):
        plan_of(**wrong)


def test_samples_are_those_of_the_camera_but_not_too_many():
    settings = SimulationSettings()
    assert default_samples(settings, 1.0) == 31
    assert default_samples(settings, 60.0) == 301
    assert default_samples(settings, 1e-3) == 2
