"""The recipe of a figure and a command in CONTRIBUTING.md, applied to a copy of the tree."""

from __future__ import annotations

import shutil

import pytest
from recipes import apply_block, code_blocks, run_python, section_of

RUN = 'import sys; from nanorocks_ros.cli.main import main; sys.exit(main())'


@pytest.fixture(scope='module')
def blocks(root):
    text = (root / 'CONTRIBUTING.md').read_text(encoding='utf-8')
    return code_blocks(section_of(text, 'Recipe: add a figure and a command'), ('py', 'patch'))


@pytest.fixture(scope='module')
def tree(blocks, source_copy, tmp_path_factory):
    copy = tmp_path_factory.mktemp('figure_recipe') / 'tree'
    shutil.copytree(source_copy, copy, symlinks=True)
    for block in blocks:
        apply_block(block, copy)
    return copy


def test_a_figure_and_a_command_change_one_line_each(blocks):
    changes = [block for block in blocks if block.startswith('+++')]
    paths = [block.splitlines()[0].removeprefix('+++ ') for block in changes]
    assert paths == ['nanorocks_ros/cli/figures/figure.py', 'nanorocks_ros/cli/main.py']
    for block in changes:
        assert sum(line.startswith('+') for line in block.splitlines()[1:]) == 1


def test_the_tests_of_the_recipe_pass(tree, blocks):
    names = [block.splitlines()[0].removeprefix('# ') for block in blocks]
    tests = [name for name in names if name.startswith('test/')]
    assert len(tests) == 2
    options = ('-q', '--noconftest', '--import-mode=importlib', '-p', 'no:cacheprovider')
    assert '4 passed' in run_python(tree, '-m', 'pytest', *options, *tests)


def test_the_new_kind_and_the_new_command_have_help(tree):
    assert 'RESULTS' in run_python(tree, '-c', RUN, 'figure', 'clusters', '--help').upper()
    assert '--trays-file' in run_python(tree, '-c', RUN, 'trays', '--help')
