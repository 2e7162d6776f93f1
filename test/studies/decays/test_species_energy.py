"""How the species of a mixture share their energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from decays import simulated_mixture, simulated_table

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.studies.decays.cooling_curves import CycleSpeeds, species_cycles
from nanorocks_ros.studies.decays.species_energy import (
    energy_ratio,
    species_energies,
    species_values,
)

TRAY = load_trays()[5]
TIMES = np.arange(0.2, 22.0, 0.2)
SPAN = (1.75, 20.0)


def cycle(number, scale, rise=False):
    law = haff_speed(TIMES, 0.01 * scale, 2.0)
    speed = law[::-1].copy() if rise else law
    return CycleSpeeds(cycle=number, times=TIMES, speed=speed, error=0.02 * speed)


def mixture(*factors):
    """Cycles with energies of glass so many times those of copper."""
    light, heavy = (species.bead_mass for species in TRAY.species)
    glass = [cycle(k, math.sqrt(factor * heavy / light)) for k, factor in enumerate(factors)]
    copper = [cycle(k, 1.0) for k in range(len(factors))]
    return species_energies(TRAY, (glass, copper), SPAN)


def test_equal_energies_have_the_ratio_one():
    ratio, error = energy_ratio(mixture(1.0, 1.0, 1.0))
    assert ratio == pytest.approx(1.0)
    assert error == pytest.approx(0.0, abs=1e-12)


def test_the_error_is_from_the_scatter_of_the_cycles():
    ratio, error = energy_ratio(mixture(0.5, 0.6, 0.7))
    logs = np.log([0.5, 0.6, 0.7])
    assert ratio == pytest.approx(math.exp(logs.mean()))
    assert error == pytest.approx(ratio * logs.std(ddof=1) / math.sqrt(3))
    assert math.isnan(energy_ratio(mixture(0.5))[1])
    assert species_values(mixture(0.5))['energy_ratio_error'] is None


def test_a_species_that_does_not_slow_down_has_no_fit_but_an_energy():
    energies = species_energies(TRAY, ([cycle(1, 1.0)], [cycle(1, 1.0, rise=True)]), SPAN)
    assert energies[0].fit is not None
    assert energies[1].fit is None
    glass, copper = species_values(energies)['species']
    assert glass['haff_time'] == pytest.approx(2.0, rel=1e-2)
    assert copper['haff_time'] is None


def test_times_may_count_from_when_the_gas_began_to_cool():
    glass = [cycle(1, 1.0)]
    early, late = (
        species_energies(TRAY, (glass, glass), SPAN, origin)[0].fit for origin in (0.0, 1.5)
    )
    assert late.initial_speed == pytest.approx(float(haff_speed(1.5, 0.01, 2.0)), rel=1e-3)
    assert late.decay_rate == pytest.approx(early.decay_rate, rel=1e-3)


def test_tables_without_two_species_have_none(tmp_path):
    table = simulated_table(tmp_path / 'tray_1_speed.csv', 1)
    # Of an earlier release, and of a single species.
    assert species_cycles(table, TRAY) == ()
    assert species_cycles(table, load_trays()[1]) == ()
    by_species = species_cycles(simulated_mixture(tmp_path / 'tray_5_speed.csv', 5, 2), TRAY)
    assert [len(cycles) for cycles in by_species] == [2, 2]
    assert species_energies(TRAY, by_species, (90.0, 99.0)) == ()
    assert species_values(()) == {
        'species': None,
        'energy_ratio': None,
        'energy_ratio_error': None,
    }
