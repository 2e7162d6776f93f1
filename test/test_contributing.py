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
TEXT = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
BLOCK = re.compile(r'^```(python|diff)\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def changed(text, lines):
    """A file with the lines that a block adds and without those that it removes, at one place."""
    before = ''.join(f'{line[1:]}\n' for line in lines if not line.startswith('+'))
    after = ''.join(f'{line[1:]}\n' for line in lines if not line.startswith('-'))
    assert text.count(before) == 1, f'{text.count(before)} places for:\n{before}'
    return text.replace(before, after)


def apply_block(block, tree):
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
    for _, block in BLOCK.findall(TEXT):
        apply_block(block, copy)
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


def test_the_recipe_takes_as_few_changes_as_it_says():
    paths = [block.splitlines()[0] for _, block in BLOCK.findall(TEXT)]
    hunks = [path for path in paths if path.startswith('+++')]
    print(f'hunks in existing files: {len(hunks)}, in {len(set(hunks))} files')
    assert len(hunks) <= 8
    new = len(paths) - len(hunks)
    counted = f'{len(hunks)} changes in {len(set(hunks))} existing files, and {new} new files'
    assert counted in ' '.join(TEXT.split())


def test_the_new_record_is_in_the_register(tree):
    code = (
        'from nanorocks_ros.records import BrightnessEstimate as record;'
        'from nanorocks_ros.studies.analysis.offline_analysis import TrayResults;'
        'from nanorocks_ros.wire.products import ARRAY_TOPICS, MEASURED;'
        'print(ARRAY_TOPICS[record].of(1), TrayResults().of(record), MEASURED[-1].name)'
    )
    assert run(tree, '-c', code).split() == ['tray_1/brightness', '[]', 'brightness']


def test_the_composition_measures_the_brightness(tree):
    code = (
        'import numpy as np;'
        'from nanorocks_ros.experiment.trays import load_trays;'
        'from nanorocks_ros.pipeline.composition import TrayStages;'
        'from nanorocks_ros.records import BrightnessEstimate, TrayImage;'
        'from nanorocks_ros.settings import PipelineSettings;'
        'gray = np.full((240, 240), 90, np.uint8);'
        'image = TrayImage(stamp_ns=0, tray=1, gray=gray);'
        'results = TrayStages(PipelineSettings(), load_trays()[1]).push(image);'
        'print([one.brightness for one in results if isinstance(one, BrightnessEstimate)])'
    )
    assert run(tree, '-c', code).strip() == '[90.0]'


def test_the_tests_of_the_recipe_pass(tree):
    files = ('test/stages/test_brightness.py', 'test/wire/test_array_layouts.py')
    options = ('-q', '--noconftest', '--import-mode=importlib')
    passed = run(tree, '-m', 'pytest', *options, *files, 'test/wire/test_products.py')
    assert ' passed' in passed


def test_the_stage_is_documented_on_the_wire(tree):
    run(tree, '-m', 'nanorocks_ros.tools.docs_pages.wire_pages')
    page = (tree / 'docs/reference/topics.md').read_text(encoding='utf-8')
    assert '`tray_K/brightness`' in page
    assert '| 2 | `brightness` | gray levels |' in page
