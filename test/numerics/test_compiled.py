"""The cache of compiled code is not used after a change of a function or constant in it."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

import nanorocks_ros
from nanorocks_ros.numerics.compiled import compiled, kernel_where

# What these processes import, installed or not.
ROOT = Path(nanorocks_ros.__file__).parents[1]

CALLER = """
from nanorocks_ros.numerics.compiled import compiled
from tried.callee import FACTOR, called

@compiled
def caller(x):
    return FACTOR * called(x)
"""
CALLEE = """
from nanorocks_ros.numerics.compiled import compiled
from tried.constants import TERM

FACTOR = {factor}

@compiled
def called(x):
    return x + TERM
"""
ASK = """
from tried.caller import caller
print(caller(10), sum(caller.stats.cache_hits.values()))
"""


def asked(folder, question=ASK, kept=None):
    """What the caller says, and how often it was found compiled."""
    done = subprocess.run(
        [sys.executable, '-c', question],
        cwd=folder,
        env={
            **os.environ,
            'PYTHONPATH': os.pathsep.join((str(folder), str(ROOT))),
            'NUMBA_CACHE_DIR': str(kept or folder / 'kept'),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return tuple(int(word) for word in done.stdout.split())


def changed(path, text):
    # Python takes its bytecode of a file of the same size and the same second.
    later = path.stat().st_mtime + 2.0
    path.write_text(text)
    os.utime(path, (later, later))


def test_a_cached_function_follows_changes_of_the_functions_and_constants_it_uses(tmp_path):
    package = tried_package(tmp_path)
    assert asked(tmp_path) == (22, 0)
    assert asked(tmp_path) == (22, 1)
    changed(package / 'callee.py', CALLEE.format(factor=3))
    assert asked(tmp_path) == (33, 0)
    # Of the same size, and two imports away.
    changed(package / 'constants.py', 'TERM = 5\n')
    assert asked(tmp_path) == (45, 0)
    assert asked(tmp_path) == (45, 1)


def tried_package(folder):
    """A package of three modules that is compiled."""
    package = folder / 'tried'
    package.mkdir(parents=True)
    (package / '__init__.py').touch()
    (package / 'constants.py').write_text('TERM = 1\n')
    (package / 'callee.py').write_text(CALLEE.format(factor=2))
    (package / 'caller.py').write_text(CALLER)
    return package


def test_installations_of_equal_code_share_what_is_compiled(tmp_path):
    kept = tmp_path / 'kept'
    for name, hits in (('first', 0), ('second', 1)):
        tried_package(tmp_path / name)
        assert asked(tmp_path / name, kept=kept) == (22, hits)
    other = tried_package(tmp_path / 'other')
    (other / 'constants.py').write_text('TERM = 5\n')
    assert asked(tmp_path / 'other', kept=kept) == (30, 0)
    # The one code has not replaced the other.
    assert asked(tmp_path / 'first', kept=kept) == (22, 1)


def test_folders_of_old_code_are_removed_when_new_code_comes(tmp_path):
    kept = tmp_path / 'kept'
    package = tried_package(tmp_path)
    asked(tmp_path, kept=kept)
    (old,) = kept.glob('tried.caller-*')
    os.utime(old, (0.0, 0.0))
    changed(package / 'constants.py', 'TERM = 5\n')
    assert asked(tmp_path, kept=kept) == (30, 0)
    assert not old.exists()
    assert len(list(kept.glob('tried.caller-*'))) == 1


PAIR = """
from typing import NamedTuple

class Pair(NamedTuple):
    low: int
    high: int
"""
TAKER = """
from nanorocks_ros.numerics.compiled import compiled
from tried.{module} import Pair

@compiled
def caller(x):
    return total(Pair(x, x))

@compiled
def total(pair):
    return pair.low + pair.high
"""
ASK_TOTAL = """
from tried.caller import Pair, total
print(total(Pair(3, 4)), sum(total.stats.cache_hits.values()))
"""


def test_the_module_of_an_argument_may_be_moved(tmp_path):
    package = tmp_path / 'tried'
    package.mkdir()
    (package / '__init__.py').touch()
    (package / 'before.py').write_text(PAIR)
    (package / 'caller.py').write_text(TAKER.format(module='before'))
    assert asked(tmp_path, ASK_TOTAL) == (7, 0)
    assert asked(tmp_path, ASK_TOTAL) == (7, 1)
    (package / 'before.py').rename(package / 'after.py')
    changed(package / 'caller.py', TAKER.format(module='after'))
    assert asked(tmp_path, ASK_TOTAL) == (7, 0)


def test_a_kernel_for_some_types_is_a_constant_for_others():
    """It is compiled for two axes alone: for one it would not even have a type."""

    @kernel_where(lambda kind: kind.ndim == 2, otherwise=-1.0)
    def corner(array):
        return array[0, 0] + array.shape[1]

    @compiled
    def asked_for(array):
        return corner(array)

    assert asked_for(np.full((2, 3), 0.5)) == 3.5
    assert asked_for(np.full(2, 0.5)) == -1.0
    assert corner(np.full((2, 3), 0.5)) == 3.5


def compiles(function):
    """Whether a function definition is compiled."""
    names = {ast.unparse(decorator).partition('(')[0] for decorator in function.decorator_list}
    return bool(names & {'compiled', 'kernel', 'kernel_where', 'inlined'})


def named(node):
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def test_no_compiled_function_hands_a_named_tuple_to_python():
    """An interrupt in the Python code that makes one ends the process."""
    trees = [ast.parse(path.read_text()) for path in (ROOT / 'nanorocks_ros').rglob('*.py')]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    tuples = {
        node.name
        for node in nodes
        if isinstance(node, ast.ClassDef)
        and 'NamedTuple' in {name for base in node.bases for name in named(base)}
    }
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    handing = {
        function.name
        for function in functions
        if compiles(function) and function.returns and named(function.returns) & tuples
    }
    assert handing, 'none is found'
    called = {
        ast.unparse(call.func)
        for function in functions
        if not compiles(function)
        for call in ast.walk(function)
        if isinstance(call, ast.Call)
    }
    assert handing & called == set()
