"""How far points of a sweep are from a decay, with covariances and a free initial speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from decays import simulated_table

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.decays.chi_square_map import chi_square, run_correlation
from nanorocks_ros.studies.decays.cooling_curves import read_decay
from nanorocks_ros.studies.decays.decay_curve import SpeedCurve, curve_at
from nanorocks_ros.studies.decays.sweep_contours import contours, reference_rate
from nanorocks_ros.studies.figures.sweep_figure import chi_square_figure
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

HERE = Workers(processes=1)
TIMES = np.linspace(0.0, 20.0, 11)
AXES = {'restitution': (0.7, 0.8, 0.89, 0.95), 'wall_restitution': (0.95, 0.99)}
TRAY = load_trays()[1]


def made(axes=AXES, runs=60, times=TIMES, keep=True, **settings):
    plan = sweep_plan(SimulationSettings(**settings), axes, times, runs, keep_runs=keep)
    return sweep(plan, workers=HERE)


@pytest.fixture(scope='module')
def grid():
    return made()


def test_with_their_covariance_other_runs_of_a_point_deviate_by_one(grid):
    values = [
        chi_square(grid, curve_of(made({}, 60, seed=seed), cycles=60))[2, 1]
        for seed in range(20, 40)
    ]
    # Chi square over its degrees of freedom: 11 times, 20 draws.
    assert np.mean(values) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / 11.0 / 20.0))


def curve_of(grid, cycles):
    return SpeedCurve(
        times=TIMES,
        speed=grid.mean_projected_speed,
        error=np.zeros(TIMES.size),
        cycles=cycles,
    )


def test_without_runs_deviations_count_as_independent(grid):
    curve = replace(curve_at(grid, (0.8, 0.99)), point=None)
    bare = replace(grid, run_mean_projected_speed=None, run_mean_speed=None)
    off = bare.mean_projected_speed - curve.speed
    expected = np.mean(off**2 / (bare.mean_projected_speed_error**2 + curve.error**2), axis=-1)
    np.testing.assert_allclose(chi_square(bare, curve), expected)
    assert not np.allclose(chi_square(grid, curve), expected)


def test_few_cycles_scatter_more_than_their_speeds_err(grid):
    curve = SpeedCurve(
        times=TIMES, speed=1.2 * grid.mean_projected_speed[0, 0], error=np.full(11, 1e-6)
    )
    bare = replace(grid, run_mean_projected_speed=None, run_mean_speed=None)
    for kind in (grid, bare):
        alone, many = (chi_square(kind, replace(curve, cycles=n))[0, 0] for n in (1, 10_000))
        assert many / alone == pytest.approx(61.0, rel=0.05)


def test_too_few_runs_give_no_correlation(grid):
    few = made({'restitution': (0.8, 0.9)}, runs=3)
    all_times = np.ones(TIMES.size, dtype=bool)
    assert run_correlation(few, all_times) is None
    correlation = run_correlation(grid, all_times)
    assert np.diag(correlation) == pytest.approx(1.0)
    # A run that is slow stays slow, but not for ever.
    assert correlation[5, 6] > 0.5 > correlation[1, 10] > 0.0


def test_a_gas_that_starts_faster_is_found_where_its_restitution_is(grid):
    fast = made({}, runs=200, mean_speed=0.0095, times=np.linspace(0.0, 14.0, 29))
    curve = SpeedCurve(
        times=fast.times, speed=fast.mean_projected_speed, error=fast.mean_projected_speed_error
    )
    free, fixed = chi_square(grid, curve, scaled=True), chi_square(grid, curve)
    assert np.unravel_index(np.argmin(free), free.shape) == (2, 1)
    assert free[2, 1] < 3.0
    assert fixed.min() > 10.0


def test_a_speed_too_far_from_that_of_the_sweep_is_refused(grid):
    curve = SpeedCurve(
        times=TIMES, speed=4.0 * grid.mean_projected_speed[2, 1], error=np.full(11, 1e-5)
    )
    with pytest.raises(ConfigurationError, match='sweep with --mean-speed'):
        chi_square(grid, curve, scaled=True)


def test_speeds_are_not_scaled_where_beads_stick(grid):
    sticky = made({'restitution': (0.8, 0.9)}, runs=3, sticking_speed=1e-4)
    with pytest.raises(ConfigurationError, match='beads stick'):
        chi_square(sticky, curve_at(grid, (0.8, 0.99)), scaled=True)


def test_the_line_of_the_confined_theory_passes_through_the_reference(grid):
    theory, ellipse = contours(grid, curve_at(grid, (0.8, 0.95)))
    assert np.interp(0.95, theory.other, theory.restitution) == pytest.approx(0.8, abs=0.02)
    # A higher restitution of the walls calls for a lower one of the beads.
    solved = np.isfinite(theory.restitution)
    assert (np.diff(theory.restitution[solved]) < 0.0).all()
    # The paper's hardly depends on the walls, and is far off.
    assert np.nanmin(ellipse.restitution) > 0.9


def test_the_line_over_widths_bends_as_their_mean_square():
    axes = {'restitution': (0.7, 0.8), 'restitution_width': (0.0, 0.4)}
    grid = made(axes, runs=40, wall_restitution=1.0)
    theory, _ = contours(grid, curve_at(grid, (0.8, 0.0)))
    assert theory.restitution[0] > theory.restitution[-1]
    squares = theory.restitution**2 + theory.other**2 / 12.0
    assert squares == pytest.approx(squares[0], rel=0.01)


@pytest.mark.parametrize(
    ('axes', 'settings'),
    [
        ({'restitution': (0.7, 0.9), 'mean_speed': (0.005, 0.007)}, {}),
        ({'mean_speed': (0.005, 0.007), 'wall_restitution': (0.9, 0.99)}, {}),
        (AXES, {'sticking_speed': 1e-4}),
        (AXES, {'tangential_restitution': 0.5}),
    ],
)
def test_there_are_no_lines_where_closed_forms_say_nothing(axes, settings):
    grid = made(axes, runs=3, **settings)
    first = tuple(values[0] for values in axes.values())
    assert contours(grid, curve_at(grid, first)) == ()


def test_a_curve_that_does_not_fall_has_no_lines(grid):
    flat = SpeedCurve(times=TIMES, speed=np.full(11, 0.002), error=np.full(11, 1e-5))
    assert contours(grid, flat) == ()


def test_the_rate_of_a_measured_decay_is_that_of_its_cycles(grid, tmp_path):
    curve = read_decay(simulated_table(tmp_path / 'tray_1_speed.csv', 40))
    simulated = reference_rate(grid, curve_at(grid, (0.89, 0.99)), TRAY)
    assert reference_rate(grid, curve, TRAY) == pytest.approx(simulated, rel=0.1)


def test_the_map_of_a_measured_decay_is_drawn(grid, tmp_path):
    table = simulated_table(tmp_path / 'tray_1_speed.csv', 18)
    chi_square_figure(tmp_path / 'a.png', grid, read_decay(table), scaled=True)
    assert (tmp_path / 'a.png').stat().st_size > 20_000
