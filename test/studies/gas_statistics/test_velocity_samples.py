"""Moments of velocities from noisy places, against the true velocities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gas_tracks import tracked_gas, with_beads_lost

from nanorocks_ros.studies.gas_statistics.displacement_windows import split_cycles
from nanorocks_ros.studies.gas_statistics.temperatures import species_temperatures
from nanorocks_ros.studies.gas_statistics.velocity_samples import (
    FOURTH,
    N_BLOCKS,
    PAIR,
    SPEED,
    XX,
    XY,
    YY,
    raw_moments,
    sample_velocities,
)


def samples_of(tracks, n_species):
    cycles = split_cycles(tracks, 1.75)
    return cycles, sample_velocities(cycles, n_species)


def true_temperatures(cycles, samples, species):
    """Mean square of the true velocities in each block, of all beads of the species."""
    frames = np.searchsorted(cycles[0].times, samples.time - 1e-6)
    records = [cycles[0].records[frame] for frame in frames]
    squares = np.array(
        [(r.velocities[r.species == species] ** 2).sum(axis=1).mean() for r in records]
    )
    return np.array([squares[samples.block == block].mean() for block in range(N_BLOCKS)])


def test_moments_without_noise_are_means_over_beads_and_pairs():
    velocities = np.random.default_rng(2).normal(size=(6, 2))
    moments = raw_moments(velocities, 0.0)
    squares = (velocities**2).sum(axis=1)
    pairs = [squares[i] * squares[j] for i in range(6) for j in range(6) if i != j]
    assert moments[XX] == pytest.approx((velocities[:, 0] ** 2).mean())
    assert moments[YY] == pytest.approx((velocities[:, 1] ** 2).mean())
    assert moments[XY] == pytest.approx((velocities[:, 0] * velocities[:, 1]).mean())
    assert moments[SPEED] == pytest.approx(np.sqrt(squares).mean())
    assert moments[FOURTH] == pytest.approx((squares**2).mean())
    assert moments[PAIR] == pytest.approx(np.mean(pairs))


def test_noise_is_taken_out_of_every_moment():
    rng = np.random.default_rng(3)
    velocities, sigma = rng.normal(size=(5, 2)), 0.3
    noisy = [raw_moments(velocities + rng.normal(0.0, sigma, (5, 2)), sigma**2)
             for _ in range(20_000)]  # fmt: skip
    mean, error = np.mean(noisy, axis=0), np.std(noisy, axis=0) / np.sqrt(len(noisy))
    true = raw_moments(velocities, 0.0)
    exact = [XX, YY, XY, FOURTH, PAIR]
    assert (np.abs(mean - true)[exact] < 4.0 * error[exact]).all()
    assert mean[SPEED] == pytest.approx(true[SPEED], rel=0.01)
    # What is subtracted is far more than the errors of these means.
    assert 8.0 * sigma**2 * (true[XX] + true[YY]) > 20.0 * error[FOURTH]


@pytest.mark.parametrize('number', [1, 3])
def test_temperatures_are_those_of_the_engine(number):
    deviations, ratios = [], []
    for run in range(4):
        gas = tracked_gas(number, run)
        n_species = len(gas.tray.species)
        cycles, samples = samples_of(gas.tracks, n_species)
        for species in range(n_species):
            part = species_temperatures(samples, gas.tray, species)
            true = 0.5 * true_temperatures(cycles, samples, species)
            measured = part.temperature.mean(axis=1)
            deviations += ((measured - true) / part.temperature_error).tolist()
            ratios += (measured / true).tolist()
    assert np.mean(np.abs(deviations) < 2.0) > 0.9
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.004)


def test_lost_beads_leave_the_temperature_and_are_in_its_error():
    gas = tracked_gas(1, 0)
    cycles, samples = samples_of(with_beads_lost(gas.tracks, 0.1), 1)
    part = species_temperatures(samples, gas.tray, 0)
    true = 0.5 * true_temperatures(cycles, samples, 0)
    assert part.share.max() < 0.8
    assert (
        np.abs(part.temperature.mean(axis=1) - true) < 2.0 * part.temperature_error
    ).mean() > 0.8


def test_energy_is_mass_times_both_components():
    gas = tracked_gas(3, 0)
    _, samples = samples_of(gas.tracks, 2)
    part = species_temperatures(samples, gas.tray, 1)
    mass = gas.tray.species[1].bead_mass
    np.testing.assert_allclose(part.energy, 0.5 * mass * part.temperature.sum(axis=1))
    assert (np.diff(part.time) > 0.0).all()


def test_beads_at_rest_give_no_velocities():
    gas = tracked_gas(1, 0)
    rng = np.random.default_rng(4)
    still = [replace(record, positions=gas.tracks[0].positions + rng.normal(0.0, 4e-6, (15, 2)))
             for record in gas.tracks[:300]]  # fmt: skip
    still = [
        replace(record, stamp_ns=moving.stamp_ns)
        for record, moving in zip(still, gas.tracks, strict=False)
    ]
    assert samples_of(still, 1)[1].time.size == 0


def test_a_lost_frame_is_not_taken_for_a_fast_one():
    gas = tracked_gas(1, 0)
    gapped = [record for k, record in enumerate(gas.tracks) if k % 40 not in (20, 21, 22)]
    cycles, samples = samples_of(gapped, 1)
    part = species_temperatures(samples, gas.tray, 0)
    true = 0.5 * true_temperatures(cycles, samples, 0)
    np.testing.assert_allclose(part.temperature.mean(axis=1), true, rtol=0.02)


def test_cycles_start_after_their_shaking_events():
    gas = tracked_gas(1, 0, seconds=6.0)
    second = [
        replace(record, cycle=2, stamp_ns=record.stamp_ns + 6_000_000_000) for record in gas.tracks
    ]
    before = [replace(record, cycle=0, stamp_ns=record.stamp_ns - 6_000_000_000)
              for record in gas.tracks]  # fmt: skip
    cycles = split_cycles([*before, *gas.tracks, *second], 1.75, 4.0)
    assert [cycle.number for cycle in cycles] == [1, 2]
    for cycle in cycles:
        assert cycle.times[0] == pytest.approx(1.767, abs=1e-3)
        assert cycle.times[-1] == pytest.approx(4.0, abs=1e-3)
    assert [cycle.number for cycle in split_cycles(before)] == [0]
