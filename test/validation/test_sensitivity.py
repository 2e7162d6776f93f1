"""What of a simulated cycle differs from what is told, and that the stages notice some of it."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks import sensitivity
from benchmarks.contacts import contacts_of
from benchmarks.sensitivity import (
    IDEAL,
    Deviation,
    SeenTray,
    cycle_of,
    tracks_of_cycle,
    true_tray,
)
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.records import Headline, PairCollision, Quality
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray

TOLD = load_trays()


def row(name):
    """The row of a name."""
    (deviation,) = [row for row in sensitivity.DEVIATIONS if row.name == name]
    return deviation


@cache
def tracks(number, deviation_name):
    """Tracks of run 0, by the name of a row."""
    return tracks_of_cycle(TOLD[number], row(deviation_name), 0)


def test_a_tray_is_told_as_it_is_where_nothing_differs():
    assert true_tray(TOLD[3], IDEAL) == TOLD[3]


def test_sizes_spread_about_their_middle_and_add_to_the_range_that_is_told():
    tray = true_tray(TOLD[3], Deviation(name='', size_spread=0.05, diameter=1.02))
    for told, true in zip(TOLD[3].species, tray.species, strict=True):
        assert true.diameter == pytest.approx(1.02 * told.diameter)
        variances = [
            (kind.diameter_high - kind.diameter_low) ** 2 / 12.0 / kind.diameter**2
            for kind in (told, true)
        ]
        assert variances[1] - variances[0] == pytest.approx(0.05**2)


@pytest.mark.parametrize(
    ('name', 'tracked'),
    [
        ('a bead missing', 14),
        ('a bead too many, tracked', 16),
        ('a bead too many, not tracked', 15),
    ],
)
def test_as_many_beads_are_expected_as_were_told(name, tracked):
    first = tracks(1, name)[0]
    assert first.ids.size == first.positions.shape[0] == tracked
    assert first.expected.tolist() == [15]


def test_beads_that_are_not_tracked_push_the_others_about():
    alone, pushed = (tracks(1, name) for name in (IDEAL.name, 'a bead too many, not tracked'))
    apart = [
        np.abs(first.velocities - second.velocities).max()
        for first, second in zip(alone, pushed, strict=True)
    ]
    assert apart[0] == 0.0
    assert max(apart) > 1e-3


def test_lengths_in_the_picture_grow_with_its_scale():
    true, seen = (tracks(1, name)[0] for name in (IDEAL.name, 'image scale +1 %'))
    assert np.allclose(seen.velocities, 1.01 * true.velocities)
    assert np.allclose(seen.radii, 1.01 * true.radii)


def test_a_tilted_camera_sees_motion_along_its_axis():
    true, seen = (tracks(1, name)[0] for name in (IDEAL.name, 'camera tilted by 2°'))
    assert np.allclose(seen.velocities[:, 1], true.velocities[:, 1])
    along = seen.velocities[:, 0] - math.cos(math.radians(2.0)) * true.velocities[:, 0]
    # Velocities after shaking are at random in space: along the axis they are as large.
    share = along.std() / true.velocities.std()
    assert share == pytest.approx(math.sin(math.radians(2.0)), rel=0.6)


def test_a_near_camera_aside_sees_vertical_motion():
    settings = with_values(
        SimulationSettings(), {'tray': 1, 'seed': 3, 'first_shake': 0.0}, 'test'
    )
    gas = ShakenTray(settings, TOLD[1])
    true = next(gas.moments(1))
    camera = SeenTray(gas, TOLD[1], row('camera at 0.2 m, 40 mm aside'))
    # Places a little later are those that the velocities in the picture say.
    step = 1e-6
    later = replace(true, positions=true.positions + step * true.velocities)
    seen = camera.seen(true)
    moved = camera.seen(later).positions - seen.positions
    assert np.allclose(moved[:, :2], step * seen.velocities[:, :2], rtol=1e-4, atol=0.0)
    extra = np.std(seen.velocities[:, 0] - true.velocities[:, 0])
    assert extra == pytest.approx(0.2 * np.std(true.velocities[:, 2]), rel=0.3)


# Their masses are not those of the diameter that is told, so collisions seem to lose momentum.
def test_collisions_of_beads_that_differ_are_found_where_the_range_of_diameters_is_told():
    name = 'diameters spread by 5 %'
    measured = [
        sum(
            isinstance(contact, PairCollision)
            for contact in contacts_of(tray, iter(tracks(1, name)))
        )
        for tray in (TOLD[1], true_tray(TOLD[1], row(name)))
    ]
    assert measured[1] > 2 * measured[0] > 0


def test_an_acceleration_is_noticed_and_the_decay_not_believed():
    quiet, _ = cycle_of(TOLD[1], IDEAL, 0)
    pulled, _ = cycle_of(TOLD[1], Deviation(name='', acceleration=(5e-4, 0.0, 0.0)), 0)
    assert Quality.ACCELERATED not in quiet.quality
    assert quiet.headline is Headline.JOINT
    assert Quality.ACCELERATED in pulled.quality
    assert pulled.headline is Headline.CONTACTS
    assert pulled.acceleration.value == pytest.approx(5e-4, rel=0.1)


def test_the_same_cycles_are_not_shifted_and_those_with_drag_are_noticed(capsys, monkeypatch):
    rows = (
        IDEAL,
        replace(IDEAL, name='the same'),
        Deviation(name='drag', simulation={'drag': 0.1}),
    )
    monkeypatch.setattr(sensitivity, '_TRAYS', (1,))
    monkeypatch.setattr(sensitivity, 'DEVIATIONS', rows)
    sensitivity.report(cycles=2, workers=Workers(processes=1))
    header, _, ideal, same, dragged = (
        [cell.strip() for cell in line.strip('|').split('|')]
        for line in capsys.readouterr().out.splitlines()
        if line.startswith('|')
    )
    shift, drag = header.index('beads: shift'), header.index('drag')
    assert abs(float(ideal[shift].split()[0])) < 0.04
    assert ideal[drag] == same[drag] == '0.00'
    assert same[shift] == '+0.0000 ± 0.0000'
    assert dragged[shift] != same[shift]
    assert dragged[drag] == '1.00'
