"""What ``import nanorocks_ros`` offers: names, types, and how little it loads."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import nanorocks_ros as nr

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ('cv2', 'matplotlib', 'numba', 'numpy', 'pandas', 'rosbags', 'scipy', 'tqdm', 'yaml')
PROGRAM = """
import os, sys
before = set(sys.modules)
import nanorocks_ros
print(*sorted({name.partition('.')[0] for name in set(sys.modules) - before}))
print(*sorted(name for name in sys.modules if name.startswith('nanorocks_ros')))
print(os.environ['OPENCV_IO_MAX_IMAGE_PIXELS'])
"""


def loaded_modules():
    environment = {k: v for k, v in os.environ.items() if k != 'OPENCV_IO_MAX_IMAGE_PIXELS'}
    program = [sys.executable, '-c', PROGRAM]
    run = subprocess.run(
        program, cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    return [line.split() for line in run.stdout.splitlines()]


def test_the_import_loads_no_library_and_still_bounds_opencv():
    modules, own, (limit,) = loaded_modules()
    assert set(modules) & set(HEAVY) == set()
    assert own == ['nanorocks_ros', 'nanorocks_ros.errors', 'nanorocks_ros.limits']
    assert int(limit) > 0


def test_every_public_name_is_there_and_documented():
    assert nr.__all__ == sorted(nr.__all__)
    for name in nr.__all__:
        value = getattr(nr, name)
        assert name in dir(nr)
        if name != '__version__':
            assert value.__doc__.strip()
            assert value.__module__.startswith('nanorocks_ros.')


def test_a_misspelt_name_is_answered_with_the_nearest():
    program = [sys.executable, '-c', 'import nanorocks_ros as nr; nr.anlyse']
    run = subprocess.run(program, cwd=ROOT, capture_output=True, text=True)
    assert "Did you mean: 'analyse'?" in run.stderr


def test_type_checkers_see_the_names_that_are_loaded():
    tree = ast.parse((ROOT / 'nanorocks_ros/__init__.py').read_text('utf-8'))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and getattr(node.test, 'id', '') == 'TYPE_CHECKING'
    )
    seen = {
        alias.asname: node.module.removeprefix('nanorocks_ros.')
        for node in block.body
        for alias in node.names
    }
    assert seen == nr._MODULES
    assert {*seen, '__version__'} == set(nr.__all__)
    assert (ROOT / 'nanorocks_ros/py.typed').is_file()


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'analyze'"):
        _ = nr.analyze


def test_submodules_are_still_imported_by_name():
    from nanorocks_ros import records

    assert records.NS == 10**9


def test_documented_use_has_the_types_that_are_promised():
    pytest.importorskip('mypy', reason='mypy is in the dev extra')
    pytest.importorskip('nanorocks_ros.nodes', reason='sources only')
    use = ROOT / 'test/interface/typed_use.py'
    command = [sys.executable, '-m', 'mypy', '--no-error-summary', str(use)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    problems = [line for line in run.stdout.splitlines() if line.startswith('test/interface')]
    assert problems == []
    assert run.returncode in (0, 1)
