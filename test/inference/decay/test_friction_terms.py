"""What friction adds to a decay: nothing without friction, a faster decay with it."""

from __future__ import annotations

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.decay_library import NUISANCES
from nanorocks_ros.inference.decay.decay_library_file import library_of
from nanorocks_ros.inference.decay.friction_terms import (
    FRICTION,
    friction_term_count,
    friction_terms,
)
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.ensemble import cooling_runs

TRAY = load_trays()[1]
BEADS, WALLS = np.array([0.85]), np.array([0.95])


def friction_of(*walls):
    points = np.zeros((len(walls), len(FRICTION)))
    points[:, 0] = walls
    return points


def test_all_terms_vanish_without_friction():
    rng = np.random.default_rng(1)
    friction = rng.normal(size=(5, 3))
    losses, nuisances = rng.random((5, 3)), rng.normal(size=(5, len(NUISANCES)))
    terms = friction_terms(losses, nuisances, friction)
    assert 2 * terms.shape[1] == friction_term_count(len(NUISANCES))
    assert np.abs(terms).max() > 0.0
    friction[:, 0] = 0.0
    assert not friction_terms(losses, nuisances, friction).any()


def test_a_library_without_friction_is_that_of_smooth_beads():
    library = library_of(TRAY)
    assert library.rough
    np.testing.assert_array_equal(
        library.log_speed(BEADS, WALLS, None, None, friction_of(0.0)),
        library.log_speed(BEADS, WALLS),
    )


def test_the_more_friction_the_faster_the_decay():
    frictions = friction_of(0.0, 0.005, 0.01, 0.02, 0.04, 0.08)
    same = np.ones(len(frictions))
    library = library_of(TRAY)
    late = library.log_speed(0.85 * same, 0.95 * same, None, None, frictions)[:, 40]
    assert (np.diff(late) < 0.0).all()


@pytest.mark.parametrize('friction', [0.01, 0.04])
def test_the_mean_decay_of_rough_beads_that_were_not_in_it_is_that_of_the_library(friction):
    library = library_of(TRAY)
    x = library.distances[(library.distances > 0.01) & (library.distances < 0.3)]
    settings = SimulationSettings(
        restitution=float(BEADS[0]),
        wall_restitution=float(WALLS[0]),
        tangential_restitution=0.4,
        wall_tangential_restitution=0.4,
        friction=friction,
        wall_friction=friction,
        seed=5,
    )
    speed = cooling_runs(settings, TRAY, np.concatenate(([0.0], x / 0.0055)), range(400))
    projected = speed.mean_projected_speed
    along = np.log(speed.times[1:] * projected[:, :1])
    measured = np.mean(
        [
            np.interp(np.log(x), log_distance, np.log(values[1:] / values[0]))
            for log_distance, values in zip(along, projected, strict=True)
        ],
        axis=0,
    )
    uniform = np.array([[0.0, 0.0, 0.0, 0.0, -1.0]])
    expected, smooth = (
        np.interp(
            np.log(x),
            np.log(library.distances),
            library.log_speed(BEADS, WALLS, None, uniform, friction_of(value))[0],
        )
        for value in (friction, 0.0)
    )
    # Their ends are cut where a run was slow.
    middle = slice(3, -6)
    assert np.abs(measured - expected)[middle].max() < 0.03 + library.friction_misfit * friction
    assert np.abs(measured - smooth)[middle].max() > 0.1
