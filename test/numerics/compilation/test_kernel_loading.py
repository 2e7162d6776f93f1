"""A compiled function that is loaded from disk does all that one does that was just compiled."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import nanorocks_ros

ROOT = Path(nanorocks_ros.__file__).parents[1]
MODULE = """
from typing import NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

class Pair(NamedTuple):
    low: int
    high: int

@compiled
def limits(values):
    if values.size == 0:
        raise ValueError('no values', values.size)
    return Pair(values.min(), values.max())

@compiled
def mirrored(values):
    copy = np.empty_like(values)
    for k in range(values.size):
        copy[k] = values[values.size - 1 - k]
    return copy

@compiled
def not_called(values):
    return values.size
"""
ASK = """
import numpy as np
from numba.core.runtime import rtsys
from lone import limits, mirrored, not_called

print(limits(np.array([3, 1, 2])), mirrored(np.arange(3)).tolist())
try:
    limits(np.arange(0))
except ValueError as error:
    print(error.args)
print('hits', [sum(kernel.stats.cache_hits.values()) for kernel in (limits, mirrored)])
print('ready to compile', rtsys._init)
"""
CALL = """
import numba
import numpy as np
from lone import Pair, limits

low = limits(np.array([3, 1, 2])).low

@numba.njit
def spread(values):
    pair = limits(values)
    return pair.high - pair.low

print(low, spread(np.array([3, 1, 2])), sum(limits.stats.cache_hits.values()))
"""


@pytest.fixture
def asked(tmp_path):
    """Return a function: what a new process prints that uses the module."""
    (tmp_path / 'lone.py').write_text(MODULE)
    paths = os.pathsep.join((str(tmp_path), str(ROOT)))
    variables = {**os.environ, 'PYTHONPATH': paths, 'NUMBA_CACHE_DIR': str(tmp_path / 'kept')}

    def ask(code):
        done = subprocess.run(
            [sys.executable, '-c', code],
            env=variables,
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        return done.stdout.splitlines()

    return ask


def test_a_loaded_function_returns_and_raises_what_the_compiled_one_did(asked):
    *compiled, hits, ready = asked(ASK)
    assert compiled == ['Pair(low=1, high=3) [2, 1, 0]', "('no values', 0)"]
    assert (hits, ready) == ('hits [0, 0]', 'ready to compile True')
    *loaded, hits, ready = asked(ASK)
    assert loaded == compiled
    assert (hits, ready) == ('hits [1, 1]', 'ready to compile False')


def test_another_function_is_compiled_with_the_code_of_a_loaded_one(asked):
    assert asked(CALL) == ['1 2 0']
    assert asked(CALL) == ['1 2 1']


def test_a_function_that_python_does_not_call_has_no_files(asked, tmp_path):
    asked(ASK)
    names = {path.name.split('-')[0] for path in (tmp_path / 'kept').rglob('*.nbc')}
    assert names == {'lone.limits', 'lone.mirrored'}
