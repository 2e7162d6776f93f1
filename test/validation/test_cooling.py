"""Cooling of inelastic spheres, against kinetic theory."""

import math

import pytest

from benchmarks.hard_sphere_runs import DIAMETER, cooling_coefficient, over_runs
from benchmarks.hard_spheres import contact_value, haff_coefficient
from nanorocks_ros.physics.kinetic_theory import kinetic_restitution

# 2048 beads at 2.6 % filling in a cube of 34 diameters, eight mean free paths: too small for
# vortices, which at these restitutions need a cube of more than 30 to outgrow the cooling.
CELLS, DENSITY = 8, 0.05


@pytest.mark.parametrize(('restitution', 'runs', 'haff_times'), [(0.95, 10, 2.0), (0.99, 6, 0.7)])
def test_haff_decay_has_the_coefficient_of_kinetic_theory(restitution, runs, haff_times):
    # Published: Haff 1983, doi:10.1017/S0022112083003419, with the integrals of kinetic theory
    # 1/(v0 tau) = sqrt(2)/6 (1 - e^2) pi d^2 n g, coefficient 0.2357; corrected for the speeds
    # of a cooling gas after van Noije, Ernst 1998, doi:10.1007/s100350050009: -0.3 % at 0.95.
    # Tolerance: 1 %, four errors of these runs; g is exact to 0.01 % at this density.
    curve = over_runs(
        lambda seed: cooling_coefficient(CELLS, DENSITY, restitution, seed, haff_times=haff_times),
        range(runs),
    )
    assert curve.error / curve.mean < 0.004
    assert curve.mean == pytest.approx(haff_coefficient(restitution), rel=0.01)
    assert curve.mean == pytest.approx(math.sqrt(2.0) / 6.0, rel=0.01)
    # And so the dilute form reads the restitution back, from the decay of the projected speed.
    loss = math.pi * DIAMETER**2 * DENSITY / DIAMETER**3 * contact_value(DENSITY)
    rate = curve.mean * 4.0 / math.pi * (1.0 - restitution**2) * loss
    read = kinetic_restitution(rate, DIAMETER, DENSITY / DIAMETER**3).value
    assert read == pytest.approx(restitution, abs=0.0006)
