import numpy as np
import pytest

from nanorocks_ros.numerics.picture_jitter import JitterMeter


def jitter_of(displacements, error=0.02, rate=30.0):
    meter = JitterMeter()
    said = []
    for k, (x, y) in enumerate(displacements):
        meter.push(k / rate, x, y, error)
        said.append(meter.jitters)
    return said


@pytest.mark.parametrize('rate', [15.0, 30.0, 120.0])
@pytest.mark.parametrize('frequency', [0.7, 1.5, 3.0])
def test_a_swing_is_no_jitter(frequency, rate):
    times = np.arange(200) / rate
    waves = 2.7 * np.sin(2.0 * np.pi * frequency * times)[:, None] * [0.8, 0.6]
    noise = np.random.default_rng(5).normal(0.0, 0.02, (200, 2))
    assert not any(jitter_of(waves + noise, rate=rate))
    assert not any(jitter_of(noise))


@pytest.mark.parametrize('seed', range(3))
def test_white_motion_is_jitter_after_twelve_pictures(seed):
    said = jitter_of(np.random.default_rng(seed).normal(0.0, 2.0, (200, 2)))
    assert not any(said[:11])
    assert np.mean(said[11:]) > 0.95


def test_a_knock_is_no_jitter():
    steps = np.zeros((60, 2))
    steps[30:] = [3.0, -2.0]
    noise = np.random.default_rng(6).normal(0.0, 0.02, steps.shape)
    assert not any(jitter_of(steps + noise))
