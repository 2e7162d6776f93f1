"""Each species of a mixture cools by a law of its own, and that is published once per cycle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.haff_law import haff_speed
from nanorocks_ros.records import (
    UNKNOWN_MEASURED,
    CorStatus,
    Measured,
    SpeedEstimate,
    SpeedMethod,
)
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator
from nanorocks_ros.stages.restitution.species_decays import species_decays

NS = 1_000_000_000
TRAY = load_trays()[5]
TIMES = np.arange(0.2, 22.0, 0.2)
# Initial speed and Haff time of each species.
LAWS = ((9e-3, 2.5), (4e-3, 2.6))


def estimate(time, first, second, noise=0.02):
    return SpeedEstimate(
        stamp_ns=round(time * NS),
        tray=TRAY.number,
        cycle=1,
        cycle_start_ns=0,
        mean_projected_speed=Measured(0.5 * (first + second), noise * 0.5 * (first + second)),
        window=0.1,
        method=SpeedMethod.TRACKING,
        species_speeds=(Measured(first, noise * first), Measured(second, noise * second)),
    )


def lawful(noise=0.02):
    rng = np.random.default_rng(1)
    speeds = [
        haff_speed(TIMES, *law) * (1.0 + noise * rng.normal(size=TIMES.size)) for law in LAWS
    ]
    return [estimate(*speed, noise) for speed in zip(TIMES, *speeds, strict=True)]


def final_of(speeds, tray=TRAY, **values):
    stage = RestitutionEstimator(with_values(PipelineSettings(), values, 'test'), tray)
    estimates = [record for speed in speeds for record in stage.push(speed)] + list(stage.flush())
    (final,) = [
        record for record in estimates if record.status in (CorStatus.FINAL, CorStatus.NO_DECAY)
    ]
    live = [record for record in estimates if record.status is CorStatus.COOLING]
    return final, live


def test_each_species_gets_its_own_law_in_the_final_estimate():
    final, _ = final_of(lawful())
    decays = zip(final.species_initial_speeds, final.species_haff_times, strict=True)
    for fitted, law in zip(decays, LAWS, strict=True):
        for measured, truth in zip(fitted, law, strict=True):
            assert 0.0 < measured.error < 0.2 * truth
            assert abs(measured.value - truth) < 3.0 * measured.error


def test_live_estimates_do_not_take_the_time_for_it():
    _, live = final_of(lawful())
    assert live
    assert {record.species_initial_speeds for record in live} == {()}
    assert {record.species_haff_times for record in live} == {()}


def test_a_species_that_is_not_known_leaves_the_other_alone():
    speeds = lawful()
    blind = [replace(speed, species_speeds=speed.species_speeds[:1]) for speed in speeds]
    whole, part = final_of(speeds)[0], final_of(blind)[0]
    assert part.species_haff_times[0] == whole.species_haff_times[0]
    assert part.species_haff_times[1] == UNKNOWN_MEASURED
    assert part.species_initial_speeds[1] == UNKNOWN_MEASURED
    assert part.restitution == whole.restitution


def test_a_few_speeds_of_a_species_are_no_decay():
    speeds = lawful()
    few = [
        replace(speed, species_speeds=(UNKNOWN_MEASURED, speed.species_speeds[1]))
        if k > 13
        else speed
        for k, speed in enumerate(speeds)
    ]
    assert final_of(few)[0].species_haff_times[0] == UNKNOWN_MEASURED
    final, _ = final_of(few, **{'cooling.min_samples': 4})
    assert final.species_haff_times[0].value > 0.0


def test_a_species_that_speeds_up_has_no_law():
    time = TIMES[TIMES > 1.75]
    rising = [
        estimate(instant, 1e-3 * (1.0 + 0.1 * instant), 4e-3 / (1.0 + instant)) for instant in time
    ]
    initial_speeds, haff_times = species_decays(TRAY, time, rising, 8)
    assert (initial_speeds[0], haff_times[0]) == (UNKNOWN_MEASURED, UNKNOWN_MEASURED)
    assert initial_speeds[1].known
    assert haff_times[1].known


def test_a_tray_of_one_species_has_none():
    assert species_decays(load_trays()[1], TIMES, lawful(), 8) == ((), ())


@pytest.mark.parametrize('number', [3, 5])
def test_species_of_a_simulated_mixture_share_the_haff_time_but_not_the_speed(number):
    tray = load_trays()[number]
    settings = SimulationSettings(
        tray=number, mean_speed=0.01, first_shake=0.0, frame_rate=5.0, seed=4
    )
    species = np.repeat(np.arange(2), [kind.count for kind in tray.species])
    times = 0.2 * np.arange(1, 101)
    speeds = np.zeros((2, times.size))
    cycles = 12
    for run in range(cycles):
        for k, moment in enumerate(ShakenTray(settings, tray, run).moments(times.size + 1)):
            projected = np.hypot(*moment.velocities[:, :2].T)
            if k:
                speeds[:, k - 1] += [projected[species == kind].mean() / cycles for kind in (0, 1)]
    late = times >= 1.75
    rows = [
        estimate(*speed, noise=0.01) for speed in zip(times[late], *speeds[:, late], strict=True)
    ]
    initial_speeds, haff_times = species_decays(tray, times[late], rows, 8)
    ratio = haff_times[0].value / haff_times[1].value
    assert abs(math.log(ratio)) < 0.2
    light = 0 if number == 5 else 1
    assert initial_speeds[light].value > 1.5 * initial_speeds[1 - light].value
