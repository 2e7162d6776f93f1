"""The paper's closed forms against the paper's own numbers."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.error_propagation import Estimate
from nanorocks_ros.physics.haff_law import granular_energy
from nanorocks_ros.physics.moving_area import (
    mean_displacement,
    mean_moving_area,
    moving_area,
)
from nanorocks_ros.physics.paper_formulas import (
    paper_instantaneous_restitution,
    paper_restitution,
    paper_restitution_estimate,
    paper_restitution_of_decay,
    paper_wall_ellipse,
    paper_wall_ellipse_as_printed,
    paper_wall_ellipse_of_decay,
)

PAPER = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text())
EXAMPLE = PAPER['worked_example_tray1']
ELLIPSE = PAPER['wall_ellipse']
TRAY = load_trays()[1]
DECAY = {
    'initial_energy': EXAMPLE['T0_J'],
    'haff_time': EXAMPLE['tau0_s'],
    'mass': 1e-6 * EXAMPLE['m_mg'],
    'diameter': TRAY.diameter,
    'number_density': TRAY.number_density,
}
SIDE = 0.015


def test_the_worked_example_gives_the_printed_restitution():
    restitution = paper_restitution(
        EXAMPLE['T0_J'],
        EXAMPLE['tau0_s'],
        1e-6 * EXAMPLE['m_mg'],
        TRAY.diameter,
        TRAY.number_density,
    )
    assert round(restitution, 2) == EXAMPLE['eps']
    assert restitution == pytest.approx(EXAMPLE['recomputed']['eps_exact_inputs'], abs=1e-12)


def test_the_form_for_speeds_is_the_form_for_energies():
    v_relative = EXAMPLE['recomputed']['v0_from_T0_mm_s'] * 1e-3
    mass = 1e-6 * EXAMPLE['m_mg']
    assert granular_energy(v_relative, mass) == pytest.approx(EXAMPLE['T0_J'])
    rate = 1.0 / (0.5 * v_relative * EXAMPLE['tau0_s'])
    restitution = paper_restitution_of_decay(rate, TRAY.diameter, TRAY.number_density)
    assert restitution == pytest.approx(EXAMPLE['recomputed']['eps_exact_inputs'], abs=1e-12)


def test_a_faster_decay_than_the_form_allows_is_a_bound_or_an_error():
    assert paper_restitution_of_decay(1e6, TRAY.diameter, TRAY.number_density) == 0.0
    with pytest.raises(FitError, match='faster than the closed form allows'):
        paper_restitution(1e-12, 1e-3, TRAY.mean_mass, TRAY.diameter, TRAY.number_density)


@pytest.mark.parametrize('bad', [0.0, -1.0, math.nan, math.inf])
def test_values_that_are_not_positive_and_finite_are_named(bad):
    with pytest.raises(ConfigurationError, match='haff_time'):
        paper_restitution(1e-10, bad, TRAY.mean_mass, TRAY.diameter, TRAY.number_density)


@pytest.mark.parametrize(
    'row', PAPER['eq1_geometry']['checks']['rows'], ids=lambda r: str(r['dx'])
)
def test_the_moving_area_is_equation_1(row):
    assert moving_area(row['dx'], 1.0) == pytest.approx(row['A'], abs=1e-12)


@pytest.mark.parametrize(
    'row', PAPER['eq1_geometry']['checks']['rows'], ids=lambda r: str(r['dx'])
)
def test_the_taylor_form_is_equation_2(row):
    assert mean_displacement(row['4Rdx'], 1.0, 'taylor') == pytest.approx(row['dx'])


def test_the_moving_area_saturates_at_two_discs():
    assert moving_area(np.array([2.0, 3.0, 50.0]), 1.0) == pytest.approx(2 * math.pi)


@given(some.floats(1e-6, 4e-3))
def test_the_mean_displacement_undoes_the_mean_area(displacement):
    area = float(mean_moving_area(displacement, 1e-3))
    assert mean_displacement(area, 1e-3, 'exact') == pytest.approx(displacement, rel=2e-3)


def test_the_mean_area_is_the_average_over_rayleigh_displacements():
    drawn = np.random.default_rng(5).rayleigh(1.0, 200_000)
    drawn *= 0.7 / drawn.mean()
    assert mean_moving_area(0.7, 1.0) == pytest.approx(moving_area(drawn, 1.0).mean(), rel=2e-3)


def test_a_saturated_area_gives_no_displacement():
    assert math.isnan(mean_displacement(2 * math.pi * 1e-6, 1e-3, 'exact'))


def test_errors_of_the_worked_example_are_those_of_the_formula():
    # 1 - e^2 goes as 1/tau and as 1/sqrt(T0): half a relative error of T0 counts.
    errors = {'haff_time': 0.04, 'initial_energy': 0.06}
    inputs = {
        name: Estimate(value=value, error=errors.get(name, 0.0) * value)
        for name, value in DECAY.items()
    }
    estimate = paper_restitution_estimate(**inputs)
    assert round(estimate.value, 2) == EXAMPLE['eps']
    loss = 1.0 - estimate.value**2
    assert estimate.error == pytest.approx(0.05 * loss / (2.0 * estimate.value), rel=1e-3)


def test_the_ellipse_has_the_axes_of_its_formula():
    ellipse = paper_wall_ellipse(**DECAY, side=SIDE)
    assert ellipse.wall_axis == pytest.approx(ELLIPSE['recomputed_L_15mm']['a'], rel=1e-9)
    assert ellipse.bead_axis == pytest.approx(ELLIPSE['recomputed_L_15mm']['b'], rel=1e-9)


def test_the_printed_axes_are_exchanged():
    ellipse = paper_wall_ellipse_as_printed(**DECAY, side=SIDE)
    assert ellipse.wall_axis == pytest.approx(ELLIPSE['printed']['a'], abs=0.01)
    assert ellipse.bead_axis == pytest.approx(ELLIPSE['printed']['b'], abs=0.05)


def test_the_ellipse_passes_where_the_paper_says():
    ellipse = paper_wall_ellipse(**DECAY, side=SIDE)
    check = ELLIPSE['check_point']
    assert ellipse.restitution(0.99) == pytest.approx(check['eps_p_on_ellipse_for_eps_w_0.99'])
    assert ellipse.restitution(1.0) == pytest.approx(check['eps_p_on_ellipse_for_eps_w_1'])
    lhs = (check['eps_w'] / ellipse.wall_axis) ** 2 + (check['eps_p'] / ellipse.bead_axis) ** 2
    assert lhs == pytest.approx(check['lhs'])


def test_the_ellipse_of_a_decay_rate_is_that_of_the_energies():
    v_relative = math.sqrt(2.0 * EXAMPLE['T0_J'] / (1e-6 * EXAMPLE['m_mg']))
    rate = 1.0 / (0.5 * v_relative * EXAMPLE['tau0_s'])
    ellipse = paper_wall_ellipse_of_decay(rate, TRAY.diameter, TRAY.number_density, SIDE)
    assert ellipse.bead_axis == pytest.approx(ELLIPSE['recomputed_L_15mm']['b'], rel=1e-9)


def test_elastic_walls_on_the_ellipse_give_the_form_without_walls():
    ellipse = paper_wall_ellipse(**DECAY, side=SIDE)
    assert ellipse.restitution(1.0) == pytest.approx(paper_restitution(**DECAY))


def test_a_decay_too_slow_for_lossy_walls_has_no_point_on_the_ellipse():
    slow = paper_wall_ellipse_of_decay(1.0, TRAY.diameter, TRAY.number_density, SIDE)
    assert math.isnan(slow.restitution(0.5))


def test_the_instantaneous_restitution_is_the_printed_formula():
    # F = n sigma v: 1.9547... collisions per second at 7 mm/s.
    rate = PAPER['instantaneous_cor']['collision_rate_check_tray1']['F_at_7mm_s']
    speed, ratio = 0.007, 0.995
    restitution = paper_instantaneous_restitution(
        speed, ratio * speed, 1.0 / 30.0, TRAY.diameter, TRAY.number_density
    )
    assert restitution == pytest.approx(ratio ** (30.0 / rate), rel=1e-12)


def test_the_instantaneous_restitution_differs_from_that_of_haffs_law():
    # -ln e stands where 1 - e^2 does: 0.89 becomes exp(-(1 - 0.89^2)) = 0.812.
    n_sigma = TRAY.number_density * math.pi * TRAY.diameter**2
    speed, step = 0.01, 1e-4
    rate = n_sigma * (1.0 - 0.89**2)
    later = speed / (1.0 + rate * speed * step)
    restitution = paper_instantaneous_restitution(
        speed, later, step, TRAY.diameter, TRAY.number_density
    )
    assert restitution == pytest.approx(math.exp(-(1.0 - 0.89**2)), rel=1e-4)


def test_speeds_that_rise_give_more_than_one_and_never_overflow():
    restitution = paper_instantaneous_restitution(1e-9, 1e-3, 1 / 30, TRAY.diameter, 1e6)
    assert 1.0 < restitution < math.inf


def test_speeds_that_are_not_positive_have_no_instantaneous_restitution():
    before, after = np.array([1e-3, 0.0, -1e-3, np.nan]), np.array([-1e-3, 1e-3, 1e-3, 1e-3])
    restitution = paper_instantaneous_restitution(
        before, after, 1.0, TRAY.diameter, TRAY.number_density
    )
    assert np.isnan(restitution).all()
