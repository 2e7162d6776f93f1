"""Decay libraries agree with simulation, and a wrong file is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library import NUISANCES
from nanorocks_ros.inference.decay.decay_library_file import (
    library_arrays,
    library_of,
    load_library,
)
from nanorocks_ros.inference.decay.friction_terms import FRICTION
from nanorocks_ros.inference.decay.library_fit import node_of
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.studies.libraries.library_nodes import LibraryPlan, cool_node

TRAYS = load_trays()


def at_node(library, number, *, rough=False):
    node = {name: np.array([value]) for name, value in node_of(number, rough=rough).items()}
    return library.log_speed(
        node['restitution'],
        node['wall_restitution'],
        node['floor_lid_restitution'],
        np.column_stack([node[name] for name in NUISANCES]),
        np.column_stack([node[name] for name in FRICTION]) if rough else None,
    )[0]


@pytest.mark.parametrize('tray', TRAYS.values(), ids=lambda tray: f'tray{tray.number}')
def test_every_tray_has_a_library_that_agrees_with_a_new_simulation_of_a_node(tray):
    library = library_of(tray)
    made = json.loads(library.made_by)
    plan = LibraryPlan(tray=tray, nodes=made['nodes'], runs=made['runs'], seed=made['seed'])
    number = 5
    runs = cool_node(plan, number)
    error = runs.std(axis=0, ddof=1) / np.sqrt(made['runs'])
    off = at_node(library, number) - runs.mean(axis=0)
    assert np.abs(off).mean() < 2.0 * error.mean() + library.misfit
    assert library.misfit < 0.08


def test_the_library_agrees_with_a_new_simulation_of_a_rough_node():
    tray = TRAYS[1]
    library = library_of(tray)
    runs = cool_node(LibraryPlan(tray=tray, nodes=1600, runs=24), 5, rough=True)
    error = runs.std(axis=0, ddof=1) / np.sqrt(24)
    off = at_node(library, 5, rough=True) - runs.mean(axis=0)
    friction = node_of(5, rough=True)['wall_friction']
    assert friction > 0.001
    most = 2.0 * error.mean() + library.misfit + library.friction_misfit * friction
    assert np.abs(off).mean() < most


def test_the_mean_decay_of_a_gas_that_was_not_in_it_is_that_of_the_library():
    tray = TRAYS[1]
    library = library_of(tray)
    x = library.distances[(library.distances > 0.01) & (library.distances < 0.3)]
    settings = SimulationSettings(restitution=0.8, wall_restitution=0.95, seed=5)
    runs = 400
    speed = cooling_runs(settings, tray, np.concatenate(([0.0], x / 0.0055)), range(runs))
    projected = speed.mean_projected_speed
    along = np.log(speed.times[1:] * projected[:, :1])
    measured = np.mean(
        [
            np.interp(np.log(x), log_distance, np.log(values[1:] / values[0]))
            for log_distance, values in zip(along, projected, strict=True)
        ],
        axis=0,
    )
    expected = np.interp(
        np.log(x),
        np.log(library.distances),
        library.log_speed(
            np.array([0.8]), np.array([0.95]), None, np.array([[0.0, 0.0, 0.0, 0.0, -1.0]])
        )[0],
    )
    # Their ends are cut where a run was slow.
    assert np.abs(measured - expected)[3:-6].max() < 0.03


def test_more_is_lost_with_less_restitution():
    library = library_of(TRAYS[1])
    beads = library.log_speed(np.array([0.6, 0.8, 0.9, 1.0]), np.full(4, 0.95))[:, 40]
    walls = library.log_speed(np.full(4, 0.9), np.array([0.8, 0.9, 0.95, 1.0]))[:, 40]
    assert (np.diff(beads) > 0.0).all()
    assert (np.diff(walls) > 0.0).all()


def test_covariances_are_symmetric_and_positive():
    library = library_of(TRAYS[1])
    for row in library.covariance:
        for covariance in row:
            np.testing.assert_allclose(covariance, covariance.T, atol=1e-7)
            assert np.linalg.eigvalsh(covariance).min() > -1e-6


def test_a_library_of_another_tray_is_refused_and_the_command_named(tmp_path):
    tray = replace(TRAYS[1], dimensions=(0.015, 0.015, 0.004))
    with pytest.raises(ConfigurationError, match=r'nanorocks library --tray 1 -o tray_1.npz'):
        library_of(tray)


def test_a_wrong_file_is_refused_and_the_command_named(tmp_path):
    path = tmp_path / 'mine.npz'
    with pytest.raises(ConfigurationError, match=r'no such decay library.*nanorocks library'):
        load_library(str(path), packaged=False)
    path.write_bytes(b'PK\x03\x04 but no more')
    with pytest.raises(ConfigurationError, match=r'damaged.*nanorocks library'):
        load_library(str(path), packaged=False)
    np.savez(path, tray=np.array('x'))
    with pytest.raises(ConfigurationError, match='damaged, or no decay library'):
        load_library(str(path), packaged=False)


def test_a_changed_byte_is_detected(tmp_path):
    path = tmp_path / 'mine.npz'
    library = library_of(TRAYS[1])
    np.savez(path, **library_arrays(library))
    again = load_library(str(path), packaged=False)
    np.testing.assert_array_equal(again.coefficients, library.coefficients)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    other = tmp_path / 'other.npz'
    other.write_bytes(content)
    with pytest.raises(ConfigurationError, match='damaged'):
        load_library(str(other), packaged=False)


@pytest.mark.parametrize('change', ['transposed', 'huge', 'text', 'no tray', 'NaN'])
def test_an_archive_of_another_form_is_refused_at_once(tmp_path, change):
    """Its checksums are right; one with many distances took minutes and all memory."""
    packaged = resources.files('nanorocks_ros.inference.decay').joinpath('libraries/tray_1.npz')
    with packaged.open('rb') as stream, np.load(stream) as file:
        arrays = dict(file)
    if change == 'transposed':
        arrays['covariance'] = arrays['covariance'].T
    elif change == 'huge':
        arrays['distances'] = np.zeros(100_000)
    elif change == 'text':
        arrays['coefficients'] = arrays['coefficients'].astype(str)
    elif change == 'no tray':
        arrays['tray'] = np.array('[1]')
    else:
        arrays['covariance'] = np.full_like(arrays['covariance'], np.nan)
    path = tmp_path / 'library.npz'
    np.savez(path, **arrays)
    with pytest.raises(ConfigurationError, match='is damaged, or no decay library; make it'):
        load_library(str(path), packaged=False)
