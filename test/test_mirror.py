"""Modules: each has a test at the same place or names it; names are unique, folders small."""

from __future__ import annotations

import ast
import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / 'nanorocks_ros'
TESTED_BY = re.compile(r'``(test/[\w/]+\.py)``')
MODULES = sorted(path for path in PACKAGE.rglob('*.py') if path.name != '__init__.py')

# "About fifteen", CONTRIBUTING.md.
MOST_MODULES = 16


def own_test(path: Path) -> Path:
    """Where the test of a module belongs."""
    folder = path.parent.relative_to(PACKAGE)
    return ROOT / 'test' / folder / f'test_{path.stem.strip("_")}.py'


@cache
def imported_modules(path: Path) -> frozenset[Path]:
    """Modules of the package that a file imports."""
    modules = set()
    for node in ast.walk(ast.parse(path.read_text('utf-8'))):
        names = []
        # The tables of commands and figures name modules beside them, which are imported late.
        if isinstance(node, ast.Constant) and path.is_relative_to(PACKAGE / 'cli'):
            listed = path.parent / f'{str(node.value).replace(".", "/")}.py'
            modules.update({listed} if re.fullmatch(r'[a-z_.]+', str(node.value)) else ())
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f'{node.module}.{alias.name}' for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            module = ROOT / name.replace('.', '/')
            modules.update(
                candidate
                for candidate in (module.with_suffix('.py'), module / '__init__.py')
                if name.startswith('nanorocks_ros') and candidate.is_file()
            )
    return frozenset(module for module in modules if module.is_file())


@cache
def reached_modules(path: Path) -> set[Path]:
    """Modules of the package that are loaded when a file is run."""
    reached: set[Path] = set()
    left = [path]
    while left:
        new = imported_modules(left.pop()) - reached
        reached |= new
        left += new
    return reached


@pytest.mark.parametrize('path', MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_has_a_test_or_names_it(path):
    if own_test(path).is_file():
        return
    doc = ast.get_docstring(ast.parse(path.read_text('utf-8'))) or ''
    named = [ROOT / name for name in TESTED_BY.findall(doc)]
    where = path.relative_to(ROOT)
    assert named, f'{where}: write {own_test(path).relative_to(ROOT)} or name the test in it'
    for test in named:
        assert test.is_file(), f'{where}: {test.relative_to(ROOT)} does not exist'
        # Tests of nodes and commands start them as processes of their own.
        if not {'nodes', 'cli'} & set(path.relative_to(PACKAGE).parts[:1]):
            assert path in reached_modules(test), f'{where}: not reached by {test}'


def test_no_two_modules_have_the_same_name():
    names = Counter(path.name for path in MODULES)
    twice = [path for path in MODULES if names[path.name] > 1]
    assert not twice, [str(path.relative_to(ROOT)) for path in sorted(twice, key=lambda p: p.name)]


def test_no_folder_holds_more_than_about_fifteen_modules():
    folders = Counter(path.parent for path in MODULES)
    large = {
        str(f.relative_to(ROOT)): count for f, count in folders.items() if count > MOST_MODULES
    }
    assert not large
