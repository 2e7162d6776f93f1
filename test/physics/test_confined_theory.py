"""The confined kinetic theory: its limits, and simulated gases."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.confined_decay import confined_restitution
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.contact_rates import bead_classes, contacts
from nanorocks_ros.physics.error_propagation import Estimate
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.physics.kinetic_theory import contact_value, kinetic_decay_rate
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.ensemble import cooling_runs
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import after_shaking

TRAYS = load_trays()
TIMES = np.linspace(2.0, 30.0, 57)


@cache
def gas(number):
    return confined_gas(TRAYS[number])


def simulated_rate(number, restitution, walls, runs):
    """Decay rate of the mean over runs, from 2 to 30 s."""
    settings = SimulationSettings(
        tray=number, restitution=restitution, wall_restitution=walls, speeds='maxwellian'
    )
    result = cooling_runs(settings, TRAYS[number], TIMES, range(runs)).mean_projected_speed
    error = result.std(axis=0) / math.sqrt(runs)
    return fit_haff(TIMES, result.mean(axis=0), error, TRAYS[number].count * runs).decay_rate


def wide_tray(side, count=200):
    """Beads of 2 mm in a cube."""
    (bead,) = TRAYS[1].species
    return replace(TRAYS[1], dimensions=(side, side, side), species=(replace(bead, count=count),))


def test_in_a_wide_box_with_elastic_walls_it_is_dilute_kinetic_theory():
    tray = wide_tray(0.4, count=3000)
    result = confined_gas(tray).decay_rate(0.9, 1.0)
    dilute = kinetic_decay_rate(0.9, tray.diameter, tray.number_density)
    assert result == pytest.approx(dilute, rel=0.02)


def test_pairs_crowd_as_carnahan_and_starling_say_in_a_wide_box():
    tray = wide_tray(0.1, count=20_000)
    beads = bead_classes(tray)
    room = tray.dimensions[0] - tray.diameter
    enskog = 19_999 / room**3 * 4.0 * math.pi * tray.diameter**2
    enskog *= contact_value(tray.count * math.pi / 6.0 * tray.diameter**3 / tray.volume)
    assert contacts(beads, tray.dimensions).pairs.sum() == pytest.approx(enskog, rel=0.05)


def test_walls_of_a_wide_box_take_the_pressure_of_carnahan_and_starling():
    # At a wall a fluid has the density p/kT: 1 + 4 phi g times that of its middle.
    tray = wide_tray(0.2, count=200_000)
    filling = tray.count * math.pi / 6.0 * tray.diameter**3 / tray.volume
    room = tray.dimensions[0] - tray.diameter
    result = contacts(bead_classes(tray), tray.dimensions).walls[0] * room
    assert result == pytest.approx(1.0 + 4.0 * filling * contact_value(filling), rel=0.03)


def test_a_bead_alone_meets_walls_once_in_each_crossing_of_its_room():
    tray = replace(TRAYS[1], species=(replace(TRAYS[1].species[0], count=1),))
    result = confined_gas(tray).contacts.walls[0]
    rooms = np.array(tray.dimensions) - tray.diameter
    assert result == pytest.approx(1.0 / rooms, rel=1e-12)


def test_an_elastic_gas_between_elastic_walls_does_not_cool():
    assert gas(5).decay_rate(1.0, 1.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('number', [1, 3, 5, 7])
def test_the_restitution_undoes_the_decay_rate(number):
    rate = gas(number).decay_rate(0.83, 0.96)
    assert gas(number).restitution(rate, 0.96) == pytest.approx(0.83, abs=1e-6)


def test_a_lower_restitution_always_cools_faster():
    rates = [gas(1).decay_rate(restitution, 0.97) for restitution in np.linspace(0.6, 1.0, 21)]
    assert (np.diff(rates) < 0.0).all()
    rates = [gas(1).decay_rate(0.9, restitution) for restitution in np.linspace(0.85, 1.0, 16)]
    assert (np.diff(rates) < 0.0).all()


def test_a_gas_in_the_steady_state_cools_by_haffs_law():
    steady = gas(3).cooling(0.85, 0.97)
    start = 0.006
    result = gas(3).speeds(TIMES, 0.85, 0.97, steady.granular_temperature * start**2)
    law = haff_speed(TIMES, start, 1.0 / (start * steady.decay_rate))
    assert result == pytest.approx(law, rel=1e-4)


def test_from_any_start_it_comes_to_the_steady_decay():
    steady = gas(1).cooling(0.85, 0.95)
    start = steady.granular_temperature * np.array([1.0, 1.0, 4.0]) * 1e-4
    times = np.linspace(20.0, 40.0, 3)
    slowness = 1.0 / gas(1).speeds(times, 0.85, 0.95, start)
    assert np.diff(slowness) / np.diff(times) == pytest.approx(steady.decay_rate, rel=0.01)


@pytest.mark.parametrize('number', [1, 3, 5, 7])
def test_elastic_beads_meet_one_another_and_the_walls_as_often_as_simulated(number):
    settings = SimulationSettings(
        tray=number, restitution=1.0, wall_restitution=1.0, speeds='maxwellian'
    )
    pairs = walls = temperature = 0.0
    for run in range(6):
        rules = rules_of(settings, TRAYS[number], run)
        beads = after_shaking(settings, rules, resting_beads(settings, TRAYS[number], run), run, 0)
        course = HardSphereGas(beads, rules).follow(220.0, (), np.array([20.0, 220.0]))
        seen = course.observations
        pairs += np.ptp(seen.pair_collisions) / 200.0 / 6.0
        walls += np.ptp(seen.wall_collisions) / 200.0 / 6.0
        energy = 0.5 * beads.masses @ (beads.velocities**2).sum(axis=1)
        temperature += 2.0 * energy / (3.0 * beads.masses.size) / 6.0
    theory = gas(number)
    squares = np.repeat(temperature / theory.beads.masses, 3).reshape(-1, 3)
    rates, at_walls = theory.collision_rates(squares)
    assert theory.beads.counts @ rates.sum(axis=1) / 2.0 == pytest.approx(pairs, rel=0.03)
    assert theory.beads.counts @ at_walls.sum(axis=1) == pytest.approx(walls, rel=0.035)


def test_the_motion_along_the_height_is_cooled_as_much_as_simulated():
    settings = SimulationSettings(
        tray=1, restitution=0.9, wall_restitution=0.9, speeds='maxwellian'
    )
    squares = np.zeros(3)
    for run in range(60):
        rules = rules_of(settings, TRAYS[1], run)
        beads = after_shaking(settings, rules, resting_beads(settings, TRAYS[1], run), run, 0)
        course = HardSphereGas(beads, rules).follow(12.0, (), np.linspace(4.0, 12.0, 33))
        result = course.observations.granular_temperature[:, 0]
        squares += (result / result.sum(axis=1, keepdims=True)).mean(axis=0)
    simulated = 2.0 * squares[2] / (squares[0] + squares[1])
    theory = gas(1).cooling(0.9, 0.9).granular_temperature[0]
    assert simulated == pytest.approx(theory[2] / theory[0], rel=0.1)
    assert simulated < 0.6


def test_light_and_heavy_beads_have_the_energies_that_are_simulated():
    # Equal energies would give the glass 4 times the mean square velocity of the acrylic beads.
    settings = SimulationSettings(
        tray=3, restitution=0.9, wall_restitution=0.95, speeds='maxwellian'
    )
    ratios = []
    for run in range(24):
        rules = rules_of(settings, TRAYS[3], run)
        beads = after_shaking(settings, rules, resting_beads(settings, TRAYS[3], run), run, 0)
        course = HardSphereGas(beads, rules).follow(20.0, (), np.linspace(8.0, 20.0, 25))
        squares = course.observations.granular_temperature[:, :, :2].mean(axis=(0, 2))
        ratios.append(squares[1] / squares[0])
    speeds = gas(3).species_speeds(gas(3).cooling(0.9, 0.95).granular_temperature)
    # Over a range of sizes the mean of squares is more than the square of means by 5 %.
    assert (speeds[1] / speeds[0]) ** 2 == pytest.approx(np.exp(np.log(ratios).mean()), rel=0.12)
    assert np.mean(ratios) > 2.5


def test_the_mean_of_the_species_is_that_of_all_beads():
    temperature = gas(5).cooling(0.85, 0.95).granular_temperature
    counts = [species.count for species in TRAYS[5].species]
    mean = np.average(gas(5).species_speeds(temperature), weights=counts)
    assert mean == pytest.approx(gas(5).mean_projected_speed(temperature))


@pytest.mark.parametrize(
    ('number', 'restitution', 'walls', 'runs'),
    [
        (1, 0.9, 0.9, 400),
        (1, 0.9, 0.99, 400),
        (1, 0.8, 0.95, 600),
        (3, 0.9, 0.95, 120),
        (3, 0.8, 0.9, 200),
        (5, 0.9, 0.9, 60),
    ],
)
def test_simulated_decays_give_the_restitution_within_a_hundredth(
    number, restitution, walls, runs
):
    # One temperature for all directions misses by 0.08 in the first of these.
    rate = simulated_rate(number, restitution, walls, runs)
    estimate = confined_restitution(TRAYS[number], rate, walls)
    assert estimate.value == pytest.approx(restitution, abs=0.01)


def test_a_width_of_the_restitution_counts_by_its_mean_square():
    # With one direction of motion the loss is 1 - <e^2> = 1 - m^2 - w^2/12; here nearly so.
    wide = gas(3).decay_rate(0.85, 1.0, width=0.3)
    alike = gas(3).decay_rate(math.sqrt(0.85**2 + 0.3**2 / 12.0), 1.0)
    assert wide == pytest.approx(alike, rel=0.01)
    assert wide < 0.98 * gas(3).decay_rate(0.85, 1.0)
    assert gas(3).restitution(wide, 1.0, width=0.3) == pytest.approx(0.85, abs=1e-6)


def test_errors_of_decay_walls_and_height_all_count():
    rate = gas(1).decay_rate(0.9, 0.97)
    decay = Estimate(value=rate, error=0.04 * rate)
    walls = Estimate(value=0.97, error=0.005)
    height = Estimate(value=0.003, error=0.0001)
    alone = [
        confined_restitution(TRAYS[1], decay, 0.97).error,
        confined_restitution(TRAYS[1], rate, walls).error,
        confined_restitution(TRAYS[1], rate, 0.97, height).error,
    ]
    every = confined_restitution(TRAYS[1], decay, walls, height)
    assert every.value == pytest.approx(0.9, abs=1e-5)
    assert min(alone) > 1e-3
    assert every.error == pytest.approx(math.hypot(*alone), rel=1e-3)


def test_a_slower_decay_than_the_walls_alone_make_is_an_error():
    with pytest.raises(FitError, match='walls of restitution'):
        gas(1).restitution(5.0, 0.9)


def test_a_decay_that_no_restitution_makes_is_an_error():
    with pytest.raises(FitError, match='no restitution makes a decay'):
        gas(1).restitution(1e4, 0.99)


def test_outside_its_range_it_gives_no_number():
    with pytest.raises(FitError, match='outside its range'):
        confined_restitution(TRAYS[3], gas(3).decay_rate(0.6, 0.95), 0.95)
    with pytest.raises(FitError, match='outside its range'):
        confined_restitution(TRAYS[3], 60.0, 0.8)


@pytest.mark.parametrize('bad', [-0.1, 1.1, math.nan])
def test_a_restitution_outside_0_to_1_is_named(bad):
    with pytest.raises(ConfigurationError, match='wall_restitution'):
        gas(1).decay_rate(0.9, bad)


def test_a_crowded_tray_is_refused_with_the_remedy():
    with pytest.raises(ConfigurationError, match='use the decay library'):
        confined_gas(wide_tray(0.02, count=900))


def test_a_bead_that_cannot_move_is_refused():
    tight = replace(TRAYS[1], dimensions=(0.015, 0.015, 0.002))
    with pytest.raises(ConfigurationError, match='fills the height'):
        confined_gas(tight)


def test_temperatures_of_the_wrong_shape_are_refused():
    with pytest.raises(ConfigurationError, match='three positive numbers'):
        gas(1).speeds(TIMES, 0.9, 0.99, np.ones(3))


@pytest.mark.parametrize('restitution', [0.5, 0.9])
def test_equal_beads_lose_one_plus_restitution_of_their_velocity_in_each_collision(restitution):
    """Summed over the axes and relative to the mean square of each, with any temperatures.

    A collision takes (1 + e) / 2 of the relative velocity along the line of centres from a bead.
    """
    temperature = np.array([[2e-5, 1.5e-5, 0.8e-5]])
    relaxation = gas(1).velocity_relaxation(temperature, restitution)
    rate = gas(1).collision_rates(temperature)[0].sum()
    assert relaxation.shape == (1, 3)
    assert relaxation.sum() == pytest.approx((1.0 + restitution) * rate)
    # Beads collide almost side by side in a flat tray.
    assert relaxation[0, 2] < 0.5 * relaxation[0, 0]


def test_light_beads_lose_more_of_their_velocity():
    relaxation = gas(5).velocity_relaxation(np.full((gas(5).beads.counts.size, 3), 1e-5), 0.9)
    masses = gas(5).beads.masses
    per_collision = relaxation.sum(axis=1) / gas(5).collision_rates(
        np.full((masses.size, 3), 1e-5)
    )[0].sum(axis=1)
    assert (np.diff(per_collision[np.argsort(masses)]) < 0.0).all()


def test_a_relaxation_needs_a_possible_restitution():
    with pytest.raises(ConfigurationError, match='restitution'):
        gas(1).velocity_relaxation(np.full((1, 3), 1e-5), 1.5)
