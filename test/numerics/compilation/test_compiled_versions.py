"""Versions of compiled functions are named by a text, and found again by it."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core import types

from nanorocks_ros.numerics.compilation.compiled_versions import (
    CompiledVersion,
    argument_text,
    argument_type,
    versions_in_use,
)
from nanorocks_ros.numerics.median import median_of
from nanorocks_ros.simulation.engine.event_loop import RunOutput

MEDIAN = 'nanorocks_ros.numerics.median'


@pytest.mark.parametrize(
    ('text', 'kind'),
    [
        ('float64', types.float64),
        ('bool', types.boolean),
        ('none', types.none),
        ('float32[2C]', types.Array(types.float32, 2, 'C')),
        ('uint8[3A,const]', types.Array(types.uint8, 3, 'A', readonly=True)),
        ('(int64,float64[1C])', types.Tuple((types.int64, types.Array(types.float64, 1, 'C')))),
        ('(float64,float64)', types.UniTuple(types.float64, 2)),
        ('(int64,(bool,bool))', types.Tuple((types.int64, types.UniTuple(types.boolean, 2)))),
        ('()', types.Tuple(())),
        ('=none', types.Omitted(None)),
        ('=float:1.5', types.Omitted(1.5)),
        ('=int:-3', types.Omitted(-3)),
        ('=bool:False', types.Omitted(False)),
    ],
)
def test_a_type_is_found_again_by_its_text(text, kind):
    assert argument_type(text) == kind
    assert argument_text(kind) == text
    # Equal numbers of other types are other versions.
    assert type(getattr(argument_type(text), 'value', None)) is type(getattr(kind, 'value', None))


def test_a_named_tuple_is_found_again_by_its_text():
    members = [types.int64] * len(RunOutput._fields)
    kind = types.BaseTuple.from_types(members, RunOutput)
    text = argument_text(kind)
    assert text.startswith('nanorocks_ros.simulation.engine.event_loop:RunOutput(int64,')
    assert argument_type(text) == kind
    assert argument_type(text).instance_class is RunOutput


@pytest.mark.parametrize(
    'text', ['float', 'float63', 'float64[2C', '(int64', 'int64 int64', 'x:Y']
)
def test_a_text_that_names_no_type_is_refused(text):
    with pytest.raises((LookupError, ImportError)):
        argument_type(text)


def test_a_type_without_a_text_is_refused():
    with pytest.raises(LookupError, match='has no text'):
        argument_text(types.List(types.int64))
    # Its members would be forgotten.
    with pytest.raises(LookupError, match='has no text'):
        argument_text(types.Array(types.int64, 1, 'C', aligned=False))


@pytest.mark.parametrize('function', ['nothing', 'np', 'annotations'])
def test_what_is_no_compiled_function_is_refused(function):
    with pytest.raises(LookupError, match=f'median.{function} is no compiled function'):
        CompiledVersion(MEDIAN, function, ()).compile()


def test_a_version_is_a_line():
    version = CompiledVersion(MEDIAN, 'median_of', ('float64[1C]', '(int64,int64)'))
    assert CompiledVersion.parse(str(version)) == version


# In a process of its own, with an empty folder.
COMPILE_ONE = """
import sys
import numpy as np
from nanorocks_ros.numerics.compilation.compiled_versions import *
from nanorocks_ros.numerics.small_cholesky import factorise

version = CompiledVersion('nanorocks_ros.numerics.small_cholesky', 'factorise', ('float64[2C]',))
print(version.is_kept(), version in versions_in_use(), version in versions_on_disk())
version.compile()
print(version.is_kept(), version in versions_in_use(), set(versions_on_disk()) == {version})
factorise(np.eye(3))
print(versions_in_use() == {version}, sum(factorise.stats.cache_misses.values()))
"""


def test_a_version_compiled_by_name_is_the_one_that_python_calls(tmp_path):
    done = subprocess.run(
        [sys.executable, '-c', COMPILE_ONE],
        env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == ['False False False', 'True True True', 'True 1']


def test_versions_in_use_are_those_that_were_called():
    assert median_of(np.array([3.0, 1.0, 2.0])) == 2.0
    version = CompiledVersion(MEDIAN, 'median_of', ('float64[1C]',))
    assert version in versions_in_use()
    assert version.is_kept()
