"""Functions that are compiled with what they call, as one unit.

That the results are those of numba's own compilation is tested by all tests of compiled code.
"""

from __future__ import annotations

import re
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core import event

from nanorocks_ros.numerics.compilation.lean_compilation import COMPILED, compile_lean


def lean(function):
    """Compiled in each run of the tests."""
    dispatcher = numba.njit(function)
    compile_lean(dispatcher)
    return dispatcher


class Table(NamedTuple):
    keys: np.ndarray
    values: np.ndarray


@lean
def value_at(table, place):
    return table.values[place] if place < table.values.size else -1.0


@lean
def both_ends(table):
    """Calls with a constant and with a variable."""
    last = table.values.size - 1
    return value_at(table, 0) + value_at(table, last)


@lean
def sorted_copies(count):
    """Uses what numba implements by functions that call themselves, and returns new arrays."""
    keys = np.arange(count)[::-1] // 2
    order = np.argsort(keys, kind='mergesort')
    return order, keys[order], np.median(keys.astype(np.float64))


@lean
def write_shares(color, floor, others, shares):
    """A loop over the pixels of a picture, with limits and a choice, but without branches."""
    pixels, empty = color.reshape(-1), floor.reshape(-1)
    flat, out = others.reshape(-1), shares.reshape(-1)
    three, one = np.uint64(3), np.uint64(1)
    least, lowest, most = np.float32(30.0), np.float32(0.0), np.float32(255.0)
    for pixel in range(out.size):
        k = np.uint64(pixel)
        level = np.float32(pixels[three * k]) + np.float32(pixels[three * k + one])
        light = np.float32(empty[three * k]) + np.float32(empty[three * k + one])
        share = np.float32(200.0) * level / max(light, least)
        value = np.uint8(min(max(share, lowest), most))
        other = flat[k]
        out[k] = value if light > least else other


@lean
def failing(x):
    if x < 0:
        raise ValueError('negative')
    return x


@lean
def calls_failing(x):
    return 2 * failing(x)


def table(*values):
    return Table(np.arange(len(values)), np.array(values, dtype=np.float64))


def test_a_constant_argument_makes_no_version_of_its_own():
    with event.install_recorder(COMPILED) as recorder:
        assert both_ends(table(1.0, 2.0, 4.0)) == 5.0
    started = [entry.data['dispatcher'] for _, entry in recorder.buffer if entry.is_start]
    assert started.count(both_ends) == started.count(value_at) == 1


def test_a_called_function_is_not_compiled_for_python():
    both_ends(table(1.0))
    assert not value_at.overloads
    assert value_at(table(3.0), 0) == 3.0
    assert len(value_at.overloads) == 1


def test_functions_of_numpy_that_call_themselves_sort_as_those_of_numpy():
    order, keys, middle = sorted_copies(7)
    expected = np.arange(7)[::-1] // 2
    assert np.array_equal(order, np.argsort(expected, kind='stable'))
    assert np.array_equal(keys, np.sort(expected))
    assert middle == np.median(expected)


def test_an_error_of_a_called_function_reaches_python():
    assert calls_failing(2) == 4
    with pytest.raises(ValueError, match='negative'):
        calls_failing(-1)


def test_a_function_compiled_by_numba_calls_one_of_this_package():
    @numba.njit
    def doubled(x):
        return 2 * failing(x)

    assert doubled(3) == 6
    with pytest.raises(ValueError, match='negative'):
        doubled(-3)


@pytest.mark.skipif(
    numba.version_info.short < (0, 60), reason='LLVM of numba 0.59 does not vectorise this loop'
)
def test_loops_are_vectorised():
    gray = np.arange(100, dtype=np.uint8).reshape(10, 10)
    color, shares = np.repeat(gray[:, :, np.newaxis], 3, axis=2), np.empty_like(gray)
    write_shares(color, color, gray, shares)
    assert shares.ravel().tolist() == [*range(16), *[200] * 84]
    (code,) = write_shares.inspect_llvm().values()
    assert re.search(r'fdiv <\d+ x float>', code)
