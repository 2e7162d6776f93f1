"""Sweeps: the same numbers whoever works them out, and however often that is interrupted."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, RecordingError, SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.journal import Journal
from nanorocks_ros.jobs.resumed_tasks import parts_folder
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.studies.sweeps.sweep_parts import COUNTS, RunRange, cool
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_result import CURVES, Sweep
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

SETTINGS = SimulationSettings(seed=7)
AXES = {'restitution': (0.7, 0.8, 0.9), 'wall_restitution': (0.9, 0.99)}
TIMES = (0.0, 0.5, 2.0, 6.0)
PLAN = sweep_plan(SETTINGS, AXES, TIMES, 20, keep_runs=True)
HERE = Workers(processes=1)
# Many small tasks.
PIECES = Workers(processes=1, task_seconds=3e-3)


@pytest.fixture(scope='module')
def straight():
    """The sweep, without interruption."""
    return sweep(PLAN, workers=HERE)


def assert_same(actual, expected):
    for name in (*CURVES, *COUNTS, 'times'):
        np.testing.assert_array_equal(getattr(actual, name), getattr(expected, name), strict=True)
    assert actual.axes == expected.axes
    assert actual.specification == expected.specification


def interrupted(output, *, after, plan=PLAN):
    """Start a sweep and press Ctrl-C once so many runs are done; what it says."""

    def press(done, total):
        if done >= after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as interruption:
        sweep(plan, output, PIECES, press)
    return str(interruption.value)


def test_a_sweep_is_the_mean_over_the_runs_of_every_point(straight):
    assert straight.mean_speed.shape == (3, 2, 4)
    assert straight.pair_collisions.shape == (3, 2)
    settings = replace(SETTINGS, restitution=0.8, wall_restitution=0.99)
    # The fourth point, counted with the last axis running fastest.
    numbers = PLAN.run_numbers(3, 0, 20)
    runs = cooling_runs(settings, load_trays()[1], TIMES, numbers)
    for name in ('mean_speed', 'mean_projected_speed'):
        values = getattr(runs, name)
        np.testing.assert_array_equal(getattr(straight, f'run_{name}')[1, 1], values)
        np.testing.assert_allclose(getattr(straight, name)[1, 1], values.mean(0), rtol=1e-13)
        error = values.std(0, ddof=1) / math.sqrt(20)
        np.testing.assert_allclose(getattr(straight, f'{name}_error')[1, 1], error, rtol=1e-12)
    assert straight.pair_collisions[1, 1] == runs.pair_collisions.sum()
    assert straight.wall_collisions[1, 1] == runs.wall_collisions.sum()


def test_a_point_is_a_sweep_without_axes():
    result = sweep(sweep_plan(SETTINGS, {}, TIMES, 1), workers=HERE)
    runs = cooling_runs(SETTINGS, load_trays()[1], TIMES, [0])
    np.testing.assert_array_equal(result.mean_speed, runs.mean_speed[0])
    assert np.isnan(result.mean_speed_error).all()
    assert result.run_mean_speed is None
    assert result.pair_collisions.shape == ()


@pytest.mark.parametrize('workers', [PIECES, Workers(processes=2, task_seconds=0.005)])
def test_neither_workers_nor_tasks_change_a_digit(straight, workers):
    reported = []
    result = sweep(PLAN, None, workers, lambda *numbers: reported.append(numbers))
    assert_same(result, straight)
    assert reported[0] == (0, 120)
    assert reported[-1] == (120, 120)
    assert reported == sorted(reported)


def test_a_killed_worker_of_a_cluster_changes_no_digit(cluster):
    plan = sweep_plan(SETTINGS, AXES, TIMES, 150)
    killed = []

    def kill(done, total):
        # Some tasks are done, and most are not.
        if done > 100 and not killed:
            cluster.workers[0].kill()
            killed.append(done)

    result = sweep(
        plan, None, Workers(scheduler=cluster.address, task_seconds=0.02), progress=kill
    )
    assert killed[0] < 600
    assert cluster.workers[0].wait() != 0
    for processes in (1, 2):
        assert_same(result, sweep(plan, workers=Workers(processes=processes)))


def test_points_are_independent_unless_common_random_numbers_are_asked_for():
    # An axis that changes nothing of the gas.
    axes = {'noise': (1.0, 2.0)}
    result = sweep(sweep_plan(SETTINGS, axes, TIMES, 2), workers=HERE)
    assert (result.mean_speed[0] != result.mean_speed[1]).all()
    plan = sweep_plan(SETTINGS, axes, TIMES, 2, common_random_numbers=True)
    common = sweep(plan, workers=HERE)
    np.testing.assert_array_equal(common.mean_speed[0], common.mean_speed[1])
    np.testing.assert_array_equal(common.mean_speed[0], result.mean_speed[0])


def test_more_runs_leave_those_there_were_as_they_are(straight):
    larger = sweep(sweep_plan(SETTINGS, AXES, TIMES, 25, keep_runs=True), workers=HERE)
    np.testing.assert_array_equal(larger.run_mean_speed[:, :, :20], straight.run_mean_speed)


def test_trays_and_names_can_be_axes(tmp_path):
    plan = sweep_plan(SETTINGS, {'tray': (3, 1), 'speeds': ('uniform', 'maxwellian')}, TIMES, 2)
    assert [tray.number for tray in plan.trays] == [1, 3]
    settings, tray = plan.point(1)
    assert (settings.tray, settings.speeds, tray) == (3, 'maxwellian', load_trays()[3])
    assert plan.name(2) == 'tray 1, speeds uniform'
    output = tmp_path / 'a.npz'
    result = sweep(replace(plan, axes=plan.axes[1:]), output, HERE)
    assert (result.mean_speed[0] != result.mean_speed[1]).all()
    assert Sweep.load(output).axes == plan.axes[1:]


def test_what_is_saved_is_read_back(tmp_path, straight):
    path = tmp_path / 'a.npz'
    result = sweep(PLAN, path, HERE)
    loaded = Sweep.load(path)
    assert_same(loaded, result)
    assert_same(loaded, straight)
    np.testing.assert_array_equal(loaded.run_mean_speed, straight.run_mean_speed)
    assert not parts_folder(path).exists()
    specification = json.loads(loaded.specification)
    assert specification['settings']['seed'] == 7
    assert specification['axes'] == {name: list(values) for name, values in AXES.items()}
    with np.load(path) as plain:
        assert plain['axis_restitution'].tolist() == [0.7, 0.8, 0.9]


@pytest.mark.parametrize('after', [0, 1, 2, 60, 119])
def test_an_interrupted_sweep_goes_on_and_ends_the_same(tmp_path, straight, after):
    output = tmp_path / 'a.npz'
    text = interrupted(output, after=after)
    assert f'of 120 runs are kept in {parts_folder(output)}; the same command goes on' in text
    reported = []
    # Otherwise divided than before.
    result = sweep(PLAN, output, HERE, lambda done, total: reported.append(done))
    assert reported[0] >= after
    assert_same(result, straight)
    assert_same(Sweep.load(output), straight)
    assert [path.name for path in tmp_path.iterdir()] == ['a.npz']


def test_a_finished_sweep_is_not_done_again(tmp_path, straight):
    output = tmp_path / 'a.npz'
    sweep(PLAN, output, HERE)
    reported = []
    assert_same(sweep(PLAN, output, HERE, lambda *numbers: reported.append(numbers)), straight)
    assert reported == []


def test_a_finished_sweep_deletes_its_parts_that_a_kill_left_but_no_others(tmp_path, straight):
    output = tmp_path / 'sweep.npz'
    interrupted(output, after=30)
    straight.save(output)
    assert_same(sweep(PLAN, output, HERE), straight)
    assert [path.name for path in tmp_path.iterdir()] == ['sweep.npz']
    other = sweep_plan(SETTINGS, AXES, TIMES, 21, keep_runs=True)
    output.unlink()
    interrupted(output, after=30, plan=other)
    straight.save(output)
    assert_same(sweep(PLAN, output, HERE), straight)
    assert parts_folder(output).is_dir()


def test_the_file_of_another_sweep_is_not_overwritten(tmp_path):
    output = tmp_path / 'a.npz'
    few = replace(PLAN, runs=2)
    sweep(replace(few, keep_runs=False), output, HERE)
    with pytest.raises(RecordingError, match=r'holds no single runs; delete it, or'):
        sweep(few, output, HERE)
    with pytest.raises(RecordingError, match=r'a.npz: holds another sweep \(runs: 2, not 20\);'):
        sweep(PLAN, output, HERE)
    output.write_text('mine')
    with pytest.raises(RecordingError, match='exists and holds no sweep; delete it, or'):
        sweep(PLAN, output, HERE)
    assert output.read_text() == 'mine'


@pytest.mark.parametrize(
    ('changed', 'difference'),
    [
        ({'runs': 21}, r'runs: 20, not 21'),
        ({'settings': replace(SETTINGS, seed=8)}, r'settings.seed: 7, not 8'),
        ({'settings': replace(SETTINGS, mean_speed=0.01)}, r'settings.mean_speed: 0.007, not'),
        ({'times': (0.0, 1.0)}, r'times: \[0.0, 0.5, 2.0, 6.0\], not \[0.0, 1.0\]'),
        ({'axes': PLAN.axes[:1]}, r'axes.wall_restitution: \[0.9, 0.99\], not null'),
        ({'common_random_numbers': True}, r'common_random_numbers: false, not true'),
    ],
)
def test_parts_of_another_question_are_refused(tmp_path, changed, difference):
    output = tmp_path / 'a.npz'
    interrupted(output, after=10)
    with pytest.raises(RecordingError, match=rf'belongs to another job \({difference}.*delete'):
        sweep(replace(PLAN, **changed), output, HERE)


def test_parts_of_another_version_are_refused(tmp_path, monkeypatch):
    output = tmp_path / 'a.npz'
    interrupted(output, after=10)
    monkeypatch.setattr('nanorocks_ros.studies.sweeps.sweep_plan.__version__', '99.0')
    with pytest.raises(RecordingError, match=r'another job \(version: ".*", not "99.0"\)'):
        sweep(PLAN, output, HERE)


def test_a_part_from_elsewhere_is_refused(tmp_path):
    output, other_output = tmp_path / 'here.npz', tmp_path / 'there.npz'
    interrupted(output, after=10)
    interrupted(other_output, after=10, plan=replace(PLAN, runs=30))
    parts_folder(output).joinpath('0-1.npz').write_bytes(
        parts_folder(other_output).joinpath('0-1.npz').read_bytes()
    )
    with pytest.raises(RecordingError, match=r'0-1.npz: is a part of another job; delete it'):
        sweep(PLAN, output, HERE)


def test_a_part_under_another_name_is_refused(tmp_path):
    output = tmp_path / 'a.npz'
    interrupted(output, after=10)
    folder = parts_folder(output)
    (folder / '0-1.npz').rename(folder / '60-61.npz')
    with pytest.raises(RecordingError, match=r'60-61.npz: is a part of another job'):
        sweep(PLAN, output, HERE)


def test_a_damaged_part_is_told_and_made_again(tmp_path, straight):
    output = tmp_path / 'a.npz'
    interrupted(output, after=40)
    cut, spoilt, *_ = sorted(parts_folder(output).glob('*.npz'))
    cut.write_bytes(cut.read_bytes()[:-40])
    content = bytearray(spoilt.read_bytes())
    # More than the header of an array, of which some bytes mean nothing.
    for offset in range(len(content) // 2, len(content) // 2 + 200):
        content[offset] ^= 1
    spoilt.write_bytes(content)
    notices = []
    result = sweep(PLAN, output, PIECES, notice=notices.append)
    assert notices == [f'{path}: is damaged; it is made again' for path in (cut, spoilt)]
    assert_same(result, straight)


def test_a_folder_in_use_is_refused(tmp_path):
    output = tmp_path / 'a.npz'
    folder = parts_folder(output)
    with Journal(folder, PLAN.specification()) as journal:
        journal.write('0-1', cool(RunRange(plan=PLAN, first=0, last=1)))
        with pytest.raises(RecordingError, match=r'a.npz.parts: is in use by another process'):
            sweep(PLAN, output, HERE)
    sweep(PLAN, output, HERE)


def test_an_output_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    (tmp_path / 'file').write_text('')
    reported = []
    with pytest.raises(RecordingError, match='cannot be written'):
        sweep(PLAN, tmp_path / 'file' / 'a.npz', HERE, lambda *numbers: reported.append(numbers))
    assert reported == []


def test_settings_that_do_not_go_together_name_the_point_and_leave_nothing_behind(tmp_path):
    axes = {'restitution': (0.8, 0.95), 'restitution_width': (0.0, 0.2)}
    plan = sweep_plan(SETTINGS, axes, TIMES, 2)
    with pytest.raises(SimulationError, match=r'^restitution 0.95, restitution_width 0.2: .*keep'):
        sweep(plan, tmp_path / 'a.npz', HERE)
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_that_is_not_there_leaves_nothing_behind(tmp_path):
    with pytest.raises(ConfigurationError, match='no address'):
        sweep(PLAN, tmp_path / 'a.npz', Workers(scheduler='nowhere'))
    assert list(tmp_path.iterdir()) == []
