"""Structure factors of ideal gases, hard spheres and clusters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gas_tracks import tracked_gas
from small_gases import acrylic, tray_of

from nanorocks_ros.studies.gas_statistics.random_arrangements import Places, random_arrangements
from nanorocks_ros.studies.gas_statistics.structure_factors import Waves, structure_factor
from nanorocks_ros.studies.gas_statistics.tray_statistics import tray_statistics

TRAY = tray_of(acrylic(15))


def drawn(n, group=1, share=1.0, seed=2):
    """Beads in groups at one place; groups are spread evenly between the walls."""
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(n):
        places = np.repeat(0.001 + 0.013 * rng.random((15 // group, 2)), group, axis=0)
        seen = rng.random(15) < share
        frames.append(Places(places[seen], np.zeros(int(seen.sum()), dtype=np.int32)))
    return frames


@pytest.mark.parametrize('share', [1.0, 0.6])
@pytest.mark.parametrize('group', [1, 5])
def test_the_structure_factor_is_the_number_of_beads_in_a_group(group, share):
    """In every wave, with no correction for the walls, also where beads are lost."""
    n = 2000
    waves = Waves(TRAY)
    powers = waves.powers(drawn(n, group, share))
    factor = structure_factor(waves, powers, np.arange(n) // 100, powers)
    np.testing.assert_allclose(factor.value, group, atol=1e-9 + 5.0 * factor.error.max())
    sigmas = (factor.value - group) / factor.error
    assert np.sqrt((sigmas**2).mean()) < 1.7
    np.testing.assert_allclose(factor.random, factor.value, rtol=1e-6)


def test_hard_spheres_are_spread_more_evenly_than_an_ideal_gas():
    waves = Waves(TRAY)
    powers = waves.powers(random_arrangements(TRAY))
    assert powers[:, waves.long].mean() == pytest.approx(0.43, abs=0.05)
    short = waves.wave_numbers > 0.9 * waves.wave_numbers.max()
    assert powers[:, short].mean() == pytest.approx(1.0, abs=0.05)


def test_one_bead_has_no_structure():
    alone = Places(np.array([[0.005, 0.005]]), np.zeros(1, dtype=np.int32))
    assert np.isnan(Waves(TRAY).powers([alone])).all()


@pytest.mark.parametrize('number', [1, 3])
def test_gases_that_do_not_stick_have_no_onset(number):
    onsets = [
        tray_statistics(gas.tracks, gas.tray).clustering[0].onset
        for gas in (tracked_gas(number, run) for run in range(6))
    ]
    assert np.isnan(onsets).all()


def test_the_onset_of_a_sticking_gas_lies_where_bodies_become_few():
    for run in range(6):
        gas = tracked_gas(1, run, sticking_speed=0.0015)
        onset = tray_statistics(gas.tracks, gas.tray).clustering[0].onset
        assert math.isfinite(onset)
        # Bodies of one bead hardly ever merge to two thirds of their number without waves.
        times = np.arange(gas.bodies.size) / 30.0
        first = times[np.argmax(gas.bodies < 15)]
        few = times[np.argmax(gas.bodies <= 4)]
        assert first <= onset <= few + 10.0
