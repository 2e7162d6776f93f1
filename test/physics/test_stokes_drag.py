"""Stokes' law, against numbers worked out apart from it."""

from __future__ import annotations

import math

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.stokes_drag import TURNING_PER_MOVING, stokes_rate, viscosity_of

# Of air at 20 degrees Celsius, [Pa s]; CRC Handbook.
AIR = 1.82e-5


def test_a_bead_slows_by_its_force_over_its_mass():
    """2 mm and 1180 kg/m^3 have 4.943 mg; 6 pi eta r is 3.431e-7 N s/m: 14.4 s."""
    mass = 1180.0 * 4.0 / 3.0 * math.pi * 1e-3**3
    assert mass == pytest.approx(4.943e-6, rel=1e-3)
    assert stokes_rate(AIR, 1180.0, 2e-3) == pytest.approx(3.431e-7 / 4.943e-6, rel=1e-3)


def test_beads_of_the_flight_stop_within_seconds_in_air():
    """Stokes times at 1 bar as others give them: acrylic 14.5 s, glass 8 s, JSC-1 5 s."""
    trays = load_trays()
    times = {
        species.material: 1.0 / stokes_rate(AIR, species.density, species.diameter)
        for number in (3, 7)
        for species in trays[number].species
    }
    assert times['acrylic'] == pytest.approx(14.5, rel=0.03)
    assert times['glass'] == pytest.approx(8.0, rel=0.1)
    assert times['JSC-1'] == pytest.approx(5.0, rel=0.2)


def test_spin_decays_by_its_torque_over_its_inertia():
    radius, density = 1e-3, 1180.0
    mass = density * 4.0 / 3.0 * math.pi * radius**3
    rate = 8.0 * math.pi * AIR * radius**3 / (0.4 * mass * radius**2)
    assert stokes_rate(AIR, density, 2e-3) * TURNING_PER_MOVING == pytest.approx(rate, rel=1e-12)
    assert rate == pytest.approx(15.0 * AIR / (density * radius**2), rel=1e-12)


def test_the_viscosity_is_the_one_of_the_rate():
    assert viscosity_of(stokes_rate(AIR, 2500.0, 1e-3), 2500.0, 1e-3) == pytest.approx(AIR)
