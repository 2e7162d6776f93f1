"""Shape of velocity distributions, against known ones and the velocities of the engine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from gas_tracks import tracked_gas

from nanorocks_ros.studies.gas_statistics.displacement_windows import split_cycles
from nanorocks_ros.studies.gas_statistics.jackknife import block_sums, jackknife
from nanorocks_ros.studies.gas_statistics.velocity_distribution import (
    EDGES,
    sonine_density,
    velocity_distribution,
)
from nanorocks_ros.studies.gas_statistics.velocity_samples import (
    N_BLOCKS,
    VelocitySamples,
    raw_moments,
    sample_velocities,
)


def drawn_samples(draw, n_beads=15, frames=4000, seed=1):
    """Independent velocities in each frame, of a gas that cools by a factor of 100."""
    rng = np.random.default_rng(seed)
    cooling = np.geomspace(1.0, 0.1, frames)
    velocities = [factor * draw(rng, n_beads) for factor in cooling]
    moments = np.array([[raw_moments(velocity, 0.0)] for velocity in velocities])
    path = np.linspace(0.0, 1.0, frames)
    return VelocitySamples(
        cycle=np.ones(frames, dtype=np.int64),
        time=path,
        path=path,
        block=np.minimum((N_BLOCKS * path).astype(np.int64), N_BLOCKS - 1),
        beads=np.full((frames, 1), float(n_beads)),
        moments=moments,
        uncorrected=moments[..., 0] + moments[..., 1],
        noise=np.zeros((frames, 1)),
        velocities=velocities,
        species=[np.zeros(n_beads, dtype=np.int32)] * frames,
    )


def maxwell(rng, n):
    return rng.normal(size=(n, 2))


def stretched(rng, n):
    return rng.normal(size=(n, 2)) * (1.2, 0.8)


def heavy(rng, n):
    """Normal velocities of two temperatures: a2 = <T^2>/<T>^2 - 1."""
    return rng.normal(size=(n, 2)) * np.where(rng.random((n, 1)) < 0.5, 1.0, 2.0)


@pytest.mark.parametrize(
    ('draw', 'cumulant', 'anisotropy'),
    [
        (maxwell, 0.0, 0.0),
        # <v^4> = 3 a^2 + 3 b^2 + 2 a b, with the variances a and b of the components.
        (stretched, (3 * 1.44**2 + 3 * 0.64**2 + 2 * 1.44 * 0.64) / 2.08**2 / 2 - 1, 0.8 / 2.08),
        (heavy, 0.5 * (1.0 + 16.0) / 2.5**2 - 1.0, 0.0),
    ],
)  # fmt: skip
def test_known_distributions_are_recovered(draw, cumulant, anisotropy):
    shapes = [velocity_distribution(drawn_samples(draw, seed=seed), 0) for seed in range(6)]
    for measured, true in (
        ([shape.fourth_cumulant for shape in shapes], cumulant),
        ([shape.anisotropy for shape in shapes], anisotropy),
        ([shape.correlation for shape in shapes], 0.0),
    ):
        sigmas = [(value.value - true) / value.error for value in measured]
        assert abs(np.mean(sigmas)) < 2.0
        assert np.mean(np.abs(sigmas) < 3.0) >= 5 / 6


def test_energy_that_few_beads_share_does_not_enter_the_cumulant():
    def sphere(rng, n):
        velocities = rng.normal(size=(n, 2))
        return velocities / np.sqrt((velocities**2).sum())

    shape = velocity_distribution(drawn_samples(sphere, n_beads=4), 0)
    # The plain ratio of moments reads -0.2 here.
    assert abs(shape.fourth_cumulant.value) < 3.0 * shape.fourth_cumulant.error < 0.1


def test_histogram_of_a_maxwellian_is_normal():
    shape = velocity_distribution(drawn_samples(maxwell), 0)
    middles = 0.5 * (EDGES[:-1] + EDGES[1:])
    assert shape.density.sum() * (EDGES[1] - EDGES[0]) == pytest.approx(1.0)
    np.testing.assert_allclose(shape.density, sonine_density(middles, 0.0), atol=0.01)


@pytest.mark.parametrize('cumulant', [-0.1, 0.0, 0.2])
def test_sonine_density_has_its_cumulant(cumulant):
    fine = np.linspace(-12.0, 12.0, 20001)
    density, width = sonine_density(fine, cumulant), fine[1] - fine[0]
    assert density.sum() * width == pytest.approx(1.0)
    assert (fine**2 * density).sum() * width == pytest.approx(1.0)
    assert (fine**4 * density).sum() * width == pytest.approx(3.0 * (1.0 + cumulant))


@pytest.mark.parametrize('number', [1, 3])
def test_tracks_give_the_cumulant_and_anisotropy_of_the_true_velocities(number):
    """The same estimate from positions and from the true velocities of the same frames."""
    sigmas = []
    for run in range(4):
        gas = tracked_gas(number, run)
        n_species = len(gas.tray.species)
        cycles = split_cycles(gas.tracks, 1.75)
        samples = sample_velocities(cycles, n_species)
        frames = np.searchsorted(cycles[0].times, samples.time - 1e-6)
        true = np.array(
            [
                [raw_moments(record.velocities[record.species == kind], 0.0)
                 for kind in range(n_species)]
                for record in (cycles[0].records[frame] for frame in frames)
            ]
        )  # fmt: skip
        for kind in range(n_species):
            measured = velocity_distribution(samples, kind)
            exact = velocity_distribution(replace(samples, moments=true), kind)
            for name in ('fourth_cumulant', 'anisotropy'):
                value = getattr(measured, name)
                sigmas.append((value.value - getattr(exact, name).value) / value.error)
    assert np.max(np.abs(sigmas)) < 1.0


def test_jackknife_gives_the_error_of_a_mean_and_the_bias_of_a_square():
    rng = np.random.default_rng(6)
    values = rng.normal(3.0, 1.0, 50)
    rows = np.column_stack((values, np.ones(50)))
    mean, error = jackknife(rows, lambda total: total[0] / total[1])
    assert error == pytest.approx(values.std(ddof=1) / math.sqrt(50.0), rel=0.03)
    assert mean == pytest.approx(values.mean())
    draws = []
    for seed in range(400):
        values = np.random.default_rng(seed).normal(0.0, 1.0, 5)
        rows = np.column_stack((values, np.ones(5)))
        draws.append(float(jackknife(rows, lambda total: (total[0] / total[1]) ** 2)[0]))
    # The plain square of the mean of 5 has the mean 0.2.
    assert abs(np.mean(draws)) < 3.0 * np.std(draws) / math.sqrt(400.0) < 0.06


def test_a_single_block_has_no_error():
    sums = block_sums(np.ones((4, 1)), np.zeros(4, dtype=np.int64), 3)
    value, error = jackknife(sums, lambda total: total[0])
    assert value == pytest.approx(4.0)
    assert math.isnan(error)
