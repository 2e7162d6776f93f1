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
from nanorocks_ros.physics.haff import granular_energy
from nanorocks_ros.physics.moving_area import (
    mean_displacement,
    mean_moving_area,
    moving_area,
    taylor_moving_area,
)
from nanorocks_ros.physics.paper import paper_restitution, paper_restitution_of_decay

PAPER = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text())
EXAMPLE = PAPER['worked_example_tray1']
TRAY = load_trays()[1]


def test_the_worked_example_gives_the_printed_restitution():
    found = paper_restitution(
        EXAMPLE['T0_J'],
        EXAMPLE['tau0_s'],
        1e-6 * EXAMPLE['m_mg'],
        TRAY.diameter,
        TRAY.number_density,
    )
    assert round(found, 2) == EXAMPLE['eps']
    assert found == pytest.approx(EXAMPLE['recomputed']['eps_exact_inputs'], abs=1e-12)


def test_the_form_for_speeds_is_the_form_for_energies():
    v_relative = EXAMPLE['recomputed']['v0_from_T0_mm_s'] * 1e-3
    mass = 1e-6 * EXAMPLE['m_mg']
    assert granular_energy(v_relative, mass) == pytest.approx(EXAMPLE['T0_J'])
    rate = 1.0 / (0.5 * v_relative * EXAMPLE['tau0_s'])
    found = paper_restitution_of_decay(rate, TRAY.diameter, TRAY.number_density)
    assert found == pytest.approx(EXAMPLE['recomputed']['eps_exact_inputs'], abs=1e-12)


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
    assert taylor_moving_area(row['dx'], 1.0) == pytest.approx(row['4Rdx'])


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


def test_a_saturated_area_says_nothing():
    assert math.isnan(mean_displacement(2 * math.pi * 1e-6, 1e-3, 'exact'))
