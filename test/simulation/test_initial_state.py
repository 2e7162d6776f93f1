"""Initial beads: inside the tray, without overlap, with the right sizes and speeds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from small_gases import acrylic, smallest_gap, tray_of

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.settings import SimulationSettings, rows
from nanorocks_ros.simulation.engine.rules.restitution_laws import (
    LAWS,
    SPEED_LAWS,
    PowerLawRestitution,
    UniformRestitution,
    ViscoelasticRestitution,
)
from nanorocks_ros.simulation.initial_state import inventory, resting_beads, rules_of
from nanorocks_ros.simulation.velocities import uniform_speeds

SETTINGS = SimulationSettings()


@pytest.mark.parametrize('number', range(1, 9))
def test_every_tray_that_was_flown_can_be_filled(number):
    tray = load_trays()[number]
    beads = resting_beads(SETTINGS, tray)
    assert beads.radii.size == tray.count
    assert not beads.velocities.any()
    i, j = np.triu_indices(tray.count, 1)
    apart = np.linalg.norm(beads.positions[i] - beads.positions[j], axis=1)
    assert np.all(apart >= beads.radii[i] + beads.radii[j])
    r = beads.radii[:, np.newaxis]
    assert np.all((beads.positions >= r) & (beads.positions <= np.array(tray.dimensions) - r))


def test_diameters_are_even_over_the_range_and_masses_those_of_spheres():
    tray = tray_of(acrylic(400, 0.0005, 0.001))
    beads = resting_beads(SETTINGS, tray)
    diameters = 2.0 * beads.radii
    assert diameters.min() >= 0.0005
    assert diameters.max() <= 0.001
    assert diameters.mean() == pytest.approx(0.00075, abs=4 * 0.0005 / math.sqrt(12 * 400))
    np.testing.assert_allclose(beads.masses, 1180.0 * math.pi / 6.0 * diameters**3, rtol=1e-14)


def test_the_drag_of_each_bead_is_that_of_the_first_species_by_density_and_size():
    tray = load_trays()[3]
    beads = resting_beads(replace(SETTINGS, drag=0.02), tray)
    acrylic_beads, glass = tray.species
    assert beads.drag[:15] == pytest.approx(0.02, rel=1e-12)
    scale = acrylic_beads.density / glass.density * (1e-3 / beads.radii[15:]) ** 2
    assert beads.drag[15:] == pytest.approx(0.02 * scale, rel=1e-12)
    assert beads.drag[15:].mean() == pytest.approx(0.036, rel=0.1)
    assert resting_beads(SETTINGS, tray).drag is None


def test_speeds_after_a_shake_are_even_from_zero_to_twice_the_mean():
    key = key_for(1, 0, Purpose.VELOCITIES)
    velocities = uniform_speeds(20_000, 0.007, key, 0)
    speeds = np.linalg.norm(velocities, axis=1)
    assert speeds.max() <= 0.014
    assert speeds.mean() == pytest.approx(0.007, abs=4 * 0.014 / math.sqrt(12 * 20_000))
    assert np.mean(speeds < 0.0035) == pytest.approx(0.25, abs=0.013)
    assert np.abs(velocities.mean(axis=0)).max() < 4 * 0.0081 / math.sqrt(3 * 20_000)
    assert not np.array_equal(velocities, uniform_speeds(20_000, 0.007, key, 1))


def test_seeds_and_runs_give_different_beads_and_the_same_ones_again():
    tray = tray_of(acrylic())
    first = resting_beads(SETTINGS, tray).positions
    np.testing.assert_array_equal(first, resting_beads(SETTINGS, tray).positions)
    assert not np.array_equal(first, resting_beads(SETTINGS, tray, run=1).positions)
    assert not np.array_equal(first, resting_beads(replace(SETTINGS, seed=2), tray).positions)


def test_a_tray_too_full_for_random_places_is_refused_in_time():
    # 80 fill 0.50 of the tray, a slit half as wide again as a bead.
    with pytest.raises(SimulationError, match=r'found room for only \d+ of 80 beads'):
        resting_beads(SETTINGS, tray_of(acrylic(80)))


def test_a_tray_too_full_for_one_place_after_the_other_is_filled_all_the_same():
    beads = resting_beads(SETTINGS, tray_of(acrylic(60)))
    assert smallest_gap(beads.positions, beads.radii) > 0.0


def test_more_beads_than_the_tray_has_volume_are_refused():
    with pytest.raises(SimulationError, match=r'fill 1\.24 of the box'):
        resting_beads(SETTINGS, tray_of(acrylic(200)))


def test_beads_larger_than_the_tray_are_refused():
    with pytest.raises(SimulationError, match=r'diameter 0\.004 m in a box 0\.003 m wide'):
        resting_beads(SETTINGS, tray_of(acrylic(1, 0.004)))


@pytest.mark.parametrize(
    'species',
    [
        acrylic(1, -0.001),
        acrylic(1, float('nan')),
        acrylic(1, 0.002, 0.001),
        acrylic(-1),
        replace(acrylic(), properties=replace(acrylic().properties, density=0.0)),
    ],
)
def test_invalid_species_are_refused(species):
    with pytest.raises(SimulationError, match='give positive sizes'):
        inventory(tray_of(species))


def test_a_tray_without_beads_is_refused():
    with pytest.raises(SimulationError, match='holds no bead'):
        inventory(tray_of(acrylic(0)))


def test_resting_beads_keep_clear_of_walls_and_each_other():
    beads = resting_beads(SETTINGS, tray_of(acrylic(15)))
    assert smallest_gap(beads.positions, beads.radii) >= 0.0


def test_restitutions_that_depend_on_speed_are_told_by_settings():
    settings = SimulationSettings(
        restitution=0.8,
        restitution_law='viscoelastic',
        wall_restitution=0.9,
        wall_restitution_law='power',
        restitution_speed=0.002,
        restitution_exponent=0.3,
        floor_lid_difference=-0.1,
    )
    rules = rules_of(settings, load_trays()[1])
    assert rules.restitution == ViscoelasticRestitution(value=0.8, at_speed=0.002)
    side = PowerLawRestitution(value=0.9, at_speed=0.002, exponent=0.3)
    assert rules.wall_restitution[:4] == [side] * 4
    assert [wall.value for wall in rules.wall_restitution[4:]] == pytest.approx([0.8, 0.8])


def test_a_restitution_drawn_at_random_cannot_depend_on_speed_as_well():
    settings = SimulationSettings(restitution_width=0.1, restitution_law='power')
    with pytest.raises(SimulationError, match=r"restitution_law: 'power' with .* of 0\.1"):
        rules_of(settings, load_trays()[1])


def test_the_settings_name_the_laws_of_the_register():
    choices = {row.name: row.bounds.choices for row in rows(SETTINGS)}
    assert choices['restitution_law'] == tuple(LAWS)
    assert choices['wall_restitution_law'] == ('constant', *SPEED_LAWS)


@pytest.mark.parametrize('law', ['constant', 'uniform'])
def test_a_uniform_restitution_is_told_by_its_name_or_its_width(law):
    settings = SimulationSettings(restitution=0.8, restitution_width=0.2, restitution_law=law)
    rules = rules_of(settings, load_trays()[1])
    assert rules.restitution == UniformRestitution(mean=0.8, width=0.2)


def test_restitutions_of_pairs_of_species_are_in_the_order_of_the_tray():
    settings = SimulationSettings(restitution_law='pairs', restitution_pairs=(0.9, 0.8, 0.7))
    rules = rules_of(settings, load_trays()[3])
    np.testing.assert_array_equal(rules.restitution, [[0.9, 0.8], [0.8, 0.7]])
    for_all = replace(settings, restitution_pairs=(0.6,))
    np.testing.assert_array_equal(
        rules_of(for_all, load_trays()[3]).restitution, np.full((2, 2), 0.6)
    )
    with pytest.raises(SimulationError, match='restitution_pairs: 3 restitutions for 1 species'):
        rules_of(settings, load_trays()[1])
