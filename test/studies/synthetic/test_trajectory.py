"""Beads and collisions of simulated runs as files."""

from __future__ import annotations

import errno
import json
import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros import __version__
from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_runs import simulate
from nanorocks_ros.studies.synthetic.trajectory import write_events, write_trajectory


def runs_of(tray=2, runs=1, **settings):
    plan = SimulationPlan(
        settings=replace(SimulationSettings(), tray=tray, seed=5, **settings),
        tray=load_trays()[tray],
        duration=1.0,
        samples=6,
        runs=runs,
        trajectory=True,
        events=True,
    )
    return simulate(plan, Workers(processes=1))


@pytest.fixture(scope='module')
def two_runs():
    return runs_of(runs=2)


def read(path):
    with np.load(path, allow_pickle=False) as arrays:
        return dict(arrays)


def test_arrays_hold_every_bead(tmp_path):
    simulated = runs_of()
    write_trajectory(tmp_path / 'run.npz', simulated)
    arrays = read(tmp_path / 'run.npz')
    assert arrays['positions'].shape == arrays['velocities'].shape == (6, 55, 3)
    assert arrays['body'].shape == (6, 55)
    assert 'spins' not in arrays
    np.testing.assert_array_equal(arrays['times'], simulated.plan.times)
    np.testing.assert_array_equal(arrays['positions'], simulated.runs[0].positions)
    np.testing.assert_array_equal(arrays['body'], np.tile(arrays['ids'], (6, 1)))
    assert list(arrays['materials'][[14, 15]]) == ['acrylic', 'glass']
    assert list(arrays['species'][[14, 15]]) == [0, 1]
    volumes = 4.0 / 3.0 * np.pi * arrays['radii'] ** 3
    np.testing.assert_allclose(arrays['masses'][:15], 1180.0 * volumes[:15])
    np.testing.assert_array_equal(arrays['box'], [0.032, 0.01, 0.003])


def test_the_drag_of_each_bead_is_written_where_there_is_a_gas(tmp_path):
    simulated = runs_of(drag=0.03)
    write_trajectory(tmp_path / 'run.npz', simulated)
    arrays = read(tmp_path / 'run.npz')
    assert arrays['drag'].shape == (55,)
    assert arrays['drag'][0] == pytest.approx(0.03, rel=1e-12)
    weights = arrays['drag'] * arrays['masses'] / arrays['radii']
    assert weights == pytest.approx(weights[0], rel=1e-9)
    assert json.loads(str(arrays['provenance']))['settings']['drag'] == 0.03
    pytest.importorskip('pyarrow')
    from pyarrow import parquet

    write_trajectory(tmp_path / 'run.parquet', simulated)
    column = parquet.read_table(tmp_path / 'run.parquet')['drag'].to_numpy()
    np.testing.assert_array_equal(column, np.tile(arrays['drag'], 6))


def test_runs_are_the_first_axis_of_what_differs(tmp_path, two_runs):
    write_trajectory(tmp_path / 'runs.npz', two_runs)
    arrays = read(tmp_path / 'runs.npz')
    assert arrays['positions'].shape == (2, 6, 55, 3)
    assert arrays['radii'].shape == arrays['masses'].shape == (2, 55)
    assert list(arrays['runs']) == [0, 1]
    np.testing.assert_array_equal(arrays['velocities'][1], two_runs.runs[1].velocities)


def test_a_file_says_what_made_it(tmp_path, two_runs):
    for write in (write_trajectory, write_events):
        write(tmp_path / 'file.npz', two_runs)
        made = json.loads(str(read(tmp_path / 'file.npz')['provenance']))
        assert made['nanorocks_ros'] == __version__
        assert made['settings']['seed'] == 5
        assert made['tray']['species'][1]['count'] == 40


def test_the_same_runs_give_the_same_bytes(tmp_path, two_runs):
    for write in (write_trajectory, write_events):
        write(tmp_path / 'one.npz', two_runs)
        write(tmp_path / 'other.npz', runs_of(runs=2))
        assert (tmp_path / 'one.npz').read_bytes() == (tmp_path / 'other.npz').read_bytes()


def test_rough_beads_have_spins_and_sticky_ones_bodies(tmp_path):
    write_trajectory(tmp_path / 'rough.npz', runs_of(tangential_restitution=0.5))
    spins = read(tmp_path / 'rough.npz')['spins']
    assert spins.shape == (6, 55, 3)
    assert spins[-1].any()
    write_trajectory(tmp_path / 'sticky.npz', runs_of(sticking_speed=0.01))
    arrays = read(tmp_path / 'sticky.npz')
    assert len(np.unique(arrays['body'][-1])) < 55
    assert (arrays['body'][-1] <= arrays['ids']).all()


def test_events_are_all_there_in_the_order_of_time(tmp_path, two_runs):
    write_events(tmp_path / 'events.npz', two_runs)
    events = read(tmp_path / 'events.npz')
    assert len(events['time']) == two_runs.events
    assert (events['type'] == 'wall').sum() == two_runs.count('wall')
    for run in (0, 1):
        assert (np.diff(events['time'][events['run'] == run]) >= 0.0).all()
    walls = events['type'] == 'wall'
    assert events['partner'][walls].max() <= 5
    # Walls of restitution 0.99 give a bead 1.99 times its momentum, and all of it twice where
    # the contact duration makes them elastic.
    masses = np.array([run.masses for run in two_runs.runs])[events['run'], events['bead']]
    given = (events['impulse'] / (masses * events['normal_speed']))[walls]
    elastic = np.isclose(given, 2.0, rtol=1e-9)
    assert elastic.sum() == two_runs.count('elastic_wall')
    np.testing.assert_allclose(given[~elastic], 1.99, rtol=1e-9)


def test_a_table_holds_what_the_arrays_do(tmp_path, two_runs):
    parquet = pytest.importorskip('pyarrow.parquet')
    write_trajectory(tmp_path / 'runs.parquet', two_runs)
    table = parquet.read_table(tmp_path / 'runs.parquet')
    assert table.num_rows == 2 * 6 * 55
    positions = np.column_stack([table[axis].to_numpy() for axis in 'xyz'])
    expected = np.array([run.positions for run in two_runs.runs])
    np.testing.assert_array_equal(positions.reshape(2, 6, 55, 3), expected)
    last = table.slice(table.num_rows - 1).to_pylist()[0]
    assert (last['run'], last['time'], last['id'], last['material']) == (1, 1.0, 54, 'glass')
    assert table.schema.field('vx').metadata[b'unit'] == b'm/s'
    assert json.loads(table.schema.metadata[b'provenance'])['runs'] == 2


def test_a_table_of_events_holds_what_the_arrays_do(tmp_path, two_runs):
    parquet = pytest.importorskip('pyarrow.parquet')
    write_events(tmp_path / 'events.parquet', two_runs)
    write_events(tmp_path / 'events.npz', two_runs)
    table = parquet.read_table(tmp_path / 'events.parquet')
    for name, values in read(tmp_path / 'events.npz').items():
        if name != 'provenance':
            assert table[name].to_pylist() == values.tolist()


def test_without_pyarrow_it_says_what_to_install(tmp_path, two_runs, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    with pytest.raises(ConfigurationError, match=r"pip install 'nanorocks_ros\[parquet\]'"):
        write_events(tmp_path / 'events.parquet', two_runs)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path, two_runs, monkeypatch):
    path = tmp_path / 'run.npz'
    path.write_bytes(b'old')

    def full(descriptor):
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full)
    with pytest.raises(RecordingError, match=r'run\.npz: cannot be written'):
        write_trajectory(path, two_runs)
    assert path.read_bytes() == b'old'
