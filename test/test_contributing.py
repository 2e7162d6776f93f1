"""The recipe in CONTRIBUTING.md, followed on a copy of the source tree, makes a stage."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r'^```(python|diff)\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def changed(text, lines):
    """A file with what a block adds, at the one place that shows the lines around it."""
    before = ''.join(f'{line[1:]}\n' for line in lines if not line.startswith('+'))
    after = ''.join(f'{line[1:]}\n' for line in lines)
    assert text.count(before) == 1, f'{text.count(before)} places for:\n{before}'
    return text.replace(before, after)


def follow(block, tree):
    first, *lines = block.splitlines()
    path = tree / re.sub(r'^(\+\+\+|#) ', '', first)
    path.parent.mkdir(parents=True, exist_ok=True)
    if first.startswith('+++'):
        path.write_text(changed(path.read_text(encoding='utf-8'), lines), encoding='utf-8')
    else:
        assert not path.exists(), path
        path.write_text('\n'.join(lines) + '\n', encoding='utf-8')


@pytest.fixture(scope='module')
def tree(source_copy, tmp_path_factory):
    copy = tmp_path_factory.mktemp('recipe') / 'tree'
    shutil.copytree(source_copy, copy, symlinks=True)
    for name in ('docs', 'test/stages', 'test/wire'):
        shutil.copytree(ROOT / name, copy / name)
    for block in BLOCK.findall((ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')):
        follow(block[1], copy)
    return copy


def run(tree, *command):
    environment = {**os.environ, 'PYTHONPATH': str(tree), 'OPENBLAS_NUM_THREADS': '1'}
    finished = subprocess.run(
        [sys.executable, *command],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout


def test_the_tests_of_the_recipe_pass(tree):
    files = ('test/stages/test_brightness.py', 'test/wire/test_layouts.py')
    passed = run(tree, '-m', 'pytest', '-q', '--noconftest', '--import-mode=importlib', *files)
    assert ' passed' in passed


def test_the_stage_is_documented_on_the_wire(tree):
    run(tree, '-m', 'nanorocks_ros.tools.docs_pages.wire_pages')
    page = (tree / 'docs/reference/topics.md').read_text(encoding='utf-8')
    assert '`tray_K/brightness`' in page
    assert '| 2 | `brightness` | gray levels |' in page
