"""Exponentials and logarithms of the four operations agree with those of the library."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nanorocks_ros.numerics.exponentials import decay_time, decayed, logarithm


@given(st.floats(0.0, 1.0, exclude_min=True, exclude_max=True))
@settings(max_examples=500)
def test_our_logarithm_is_right_to_three_units_in_the_last_place(x):
    assert logarithm(x) == pytest.approx(math.log(x), rel=0.0, abs=3.0 * math.ulp(math.log(x)))


def test_it_is_right_next_to_one_and_next_to_the_halvings():
    for x in (1.0 - 2.0**-53, math.sqrt(0.5), math.nextafter(math.sqrt(0.5), 0.0), 2.0**-104):
        assert logarithm(x) == pytest.approx(math.log(x), rel=4e-16)


@given(st.floats(1e-300, 700.0))
@settings(max_examples=500)
def test_what_has_gone_and_what_is_left_of_a_decay_have_all_digits(x):
    gone, left = decayed(x)
    assert gone == pytest.approx(-math.expm1(-x), rel=2e-15)
    # Each halving of the time doubles the error: 12 of them at 700.
    assert left == pytest.approx(math.exp(-x), rel=max(1e-15, 1e-15 * x))


@given(st.floats(1e-300, 0.999))
@settings(max_examples=500)
def test_the_time_of_a_decay_is_the_inverse(gone):
    time = decay_time(gone)
    assert time == pytest.approx(-math.log1p(-gone), rel=2e-15)
    assert decayed(time)[0] == pytest.approx(gone, rel=2e-15 * (1.0 + time))


def test_a_decay_starts_with_nothing_gone_and_ends_with_all():
    assert decayed(0.0) == (0.0, 1.0)
    assert decayed(math.inf) == (1.0, 0.0)
    assert decay_time(0.0) == 0.0
    assert decay_time(1.0) == decay_time(2.0) == decay_time(math.inf) == math.inf
