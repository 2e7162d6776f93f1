"""Building a decay library: resumed after an interruption, refused when it cannot be."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, RecordingError, SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library import tray_key
from nanorocks_ros.inference.decay.decay_library_file import library_of, load_library
from nanorocks_ros.inference.decay.library_fit import distances, fewest_rough_nodes
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.simulation.initial_state import rules_of
from nanorocks_ros.studies.libraries.decay_simulations import build_library
from nanorocks_ros.studies.libraries.library_nodes import (
    MEAN_SPEED,
    LibraryPlan,
    cool_node,
    simulated_node,
)

TRAY = load_trays()[1]
# Few beads in few runs: quick, and of no use but to see how it is made.
PLAN = LibraryPlan(
    tray=replace(TRAY, species=(replace(TRAY.species[0], count=3),)), nodes=256, runs=2
)
HERE = Workers(processes=1)


class Enough(KeyboardInterrupt):
    """Ctrl-C at a certain moment."""


def test_an_interrupted_build_goes_on_and_ends_in_the_same_library(tmp_path):
    whole, path = tmp_path / 'whole.npz', tmp_path / 'mine.npz'
    build_library(PLAN, whole, HERE)
    reported = []

    def stop(done, total):
        reported.append(done)
        if done == 10:
            raise Enough

    with pytest.raises(KeyboardInterrupt, match=r'10 of \d+ parts are kept in .*mine.npz.parts'):
        build_library(PLAN, path, HERE, stop)
    assert not path.exists()
    counts = []
    build_library(PLAN, path, HERE, lambda done, total: counts.append((done, total)))
    assert counts[0] == (10, 64)
    assert counts[-1] == (64, 64)
    uninterrupted, resumed = (load_library(str(name), packaged=False) for name in (whole, path))
    np.testing.assert_array_equal(uninterrupted.coefficients, resumed.coefficients)
    np.testing.assert_array_equal(uninterrupted.covariance, resumed.covariance)
    assert uninterrupted.tray == tray_key(PLAN.tray)
    assert not path.with_name('mine.npz.parts').exists()


def test_a_library_with_rough_beads_is_that_of_smooth_ones_and_what_friction_adds(tmp_path):
    few = replace(PLAN.tray, species=(replace(TRAY.species[0], count=2),))
    plan = replace(PLAN, tray=few, rough_nodes=fewest_rough_nodes())
    counts = []
    rough = build_library(plan, tmp_path / 'rough.npz', HERE, lambda *done: counts.append(done))
    assert counts[-1] == (64 + 47, 64 + 47)
    smooth = build_library(replace(plan, rough_nodes=0), tmp_path / 'smooth.npz', HERE)
    assert rough.rough
    assert not smooth.rough
    np.testing.assert_array_equal(rough.coefficients, smooth.coefficients)
    points = np.array([0.8]), np.array([0.95])
    friction = np.array([[0.05, 0.0, 0.0]])
    slower = rough.log_speed(*points, None, None, friction) - smooth.log_speed(*points)
    assert slower[0, 30:].mean() < -0.1
    loaded = load_library(str(tmp_path / 'rough.npz'), packaged=False)
    np.testing.assert_array_equal(loaded.friction_coefficients, rough.friction_coefficients)
    assert load_library(str(tmp_path / 'smooth.npz'), packaged=False).rough is False


def test_parts_of_another_library_are_not_mixed_in(tmp_path):
    path = tmp_path / 'mine.npz'

    def stop(done, total):
        if done == 1:
            raise Enough

    with pytest.raises(KeyboardInterrupt):
        build_library(PLAN, path, HERE, stop)
    with pytest.raises(RecordingError, match='belongs to another job'):
        build_library(replace(PLAN, seed=2), path, HERE)


def test_a_library_made_with_drag_says_so_and_is_not_compared_with_decays(tmp_path):
    path = tmp_path / 'dragged.npz'
    plan = replace(PLAN, drag=0.05)
    build_library(plan, path, HERE)
    library = load_library(str(path), packaged=False)
    assert library.tray == tray_key(PLAN.tray, {'drag': 0.05}) != tray_key(PLAN.tray)
    assert json.loads(library.made_by)['tray']['drag'] == 0.05
    with pytest.raises(ConfigurationError, match=r'drag of 0.05 1/s.*make one without drag'):
        library_of(PLAN.tray, path)
    assert 'drag' not in json.loads(PLAN.specification())['tray']
    with pytest.raises(ConfigurationError, match='drag'):
        build_library(replace(PLAN, drag=-1.0), tmp_path / 'negative.npz', HERE)


LAW = {
    'restitution_law': 'power',
    'wall_restitution_law': 'constant',
    'restitution_width': 0.0,
    'restitution_speed': 0.005,
    'restitution_exponent': 0.6,
    'restitution_pairs': (0.89,),
}


def test_a_library_of_a_law_says_so_and_is_not_compared_with_decays(tmp_path):
    path = tmp_path / 'power.npz'
    plan = replace(PLAN, law=LAW)
    library = build_library(plan, path, HERE)
    assert json.loads(library.tray)['law']['restitution_exponent'] == 0.6
    with pytest.raises(ConfigurationError, match=r'with the laws power .*make one without a law'):
        library_of(PLAN.tray, path)
    wrong = {**LAW, 'restitution_law': 'pairs', 'restitution_pairs': (0.9, 0.8, 0.7)}
    with pytest.raises(SimulationError, match='3 restitutions for 1 species'):
        build_library(replace(PLAN, law=wrong), tmp_path / 'wrong.npz', HERE)


def test_a_power_of_speed_cools_slow_beads_less():
    plan = replace(PLAN, tray=TRAY, runs=20)
    constant, falling = (cool_node(replace(plan, law=law), 7).mean(axis=0) for law in ({}, LAW))
    # At the reference speed both lose the same; far below it the power law loses less.
    assert falling[-1] > constant[-1] + 0.1


def test_pairs_of_species_keep_the_ratio_of_their_losses_at_every_node():
    mixture = replace(PLAN, tray=load_trays()[3])
    law = {**LAW, 'restitution_law': 'pairs', 'restitution_pairs': (0.9, 0.8, 0.7)}
    settings, tray = simulated_node(replace(mixture, law=law), 4)
    first, second, third = settings.restitution_pairs
    assert first == pytest.approx(settings.restitution)
    assert 1.0 - second == pytest.approx(2.0 * (1.0 - first))
    assert 1.0 - third == pytest.approx(3.0 * (1.0 - first))
    assert rules_of(settings, tray).restitution[0, 1] == second


def test_a_uniform_distribution_stays_within_0_and_1_at_every_node():
    law = {**LAW, 'restitution_law': 'uniform', 'restitution_width': 0.3}
    for number in range(20):
        settings, tray = simulated_node(replace(PLAN, law=law), number)
        rules_of(settings, tray)
        assert settings.restitution_width <= 0.3


def test_decays_with_drag_are_those_without_in_another_clock():
    plan = replace(PLAN, tray=TRAY, runs=60)
    rate = 0.05
    free, dragged = (cool_node(replace(plan, drag=drag), 7).mean(axis=0) for drag in (0.0, rate))
    # The mean projected speed is pi/4 of that in space, which each run scatters about by 15 %.
    time = distances() / (0.25 * math.pi * MEAN_SPEED)
    early = time < 0.5 / rate
    expected = np.interp(-np.expm1(-rate * time) / rate, time, free) - rate * time
    assert dragged[early] == pytest.approx(expected[early], abs=0.05)
    assert dragged[early][-1] < free[early][-1] - 0.2


def test_too_few_nodes_are_refused_before_any_work(tmp_path):
    for plan in (replace(PLAN, nodes=253), replace(PLAN, runs=1)):
        with pytest.raises(ConfigurationError, match='give 254 and 2 or more'):
            build_library(plan, tmp_path / 'mine.npz', HERE)
    with pytest.raises(ConfigurationError, match=r'give 0, or 188 or more'):
        build_library(replace(PLAN, rough_nodes=187), tmp_path / 'mine.npz', HERE)
    assert not list(tmp_path.iterdir())
