"""Every table of the documentation has the columns that the benchmark named above it prints today.

The benchmarks take minutes to days; their headers are compared without running them.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / 'docs').rglob('*.md'))
# Pages of results. On the other pages the command is named beside its table.
RESULTS = ROOT / 'docs' / 'validation'
BESIDE = 8
COMMAND = re.compile(r'python -m\s+benchmarks[. ](\w+)')
RULE = re.compile(r'\|( *:?-+:? *\|)+$')
# Above a table that no command prints in this form.
BY_HAND = '<!-- table by hand -->'


@cache
def cells_of(module):
    """Cells of the texts of a benchmark and of the benchmarks that it imports.

    A field of an f-string is a NUL.
    """
    modules, waiting = set(), [module]
    while waiting:
        path = ROOT / 'benchmarks' / f'{waiting.pop().replace(".", "/")}.py'
        if path.is_file() and path not in modules:
            modules.add(path)
            waiting += imported(ast.parse(path.read_text()))
    texts = (
        text
        for path in modules
        for node in ast.walk(ast.parse(path.read_text()))
        for text in printed(node)
    )
    return {cell.strip() for text in texts for cell in re.split(r'[|\n]', text)}


def imported(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('benchmarks'):
            below = node.module.partition('.')[2]
            yield from [below] if below else [alias.name for alias in node.names]


def printed(node):
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        parts = (part.value if isinstance(part, ast.Constant) else '\0' for part in node.values)
        yield ''.join(parts)


def is_printed(cell, module):
    """Whether a benchmark has the text of a column, with numbers or words in its fields."""
    if cell in cells_of(module):
        return True
    computed = (text for text in cells_of(module) if '\0' in text and text.strip('\0 '))
    return any(
        re.fullmatch(re.escape(text).replace(re.escape('\0'), r'[\w.,-]+'), cell)
        for text in computed
    )


def tables(page):
    """Number of the line, header and nearest benchmark of each table of a page."""
    lines = page.read_text(encoding='utf-8').splitlines()
    for k, line in enumerate(lines):
        if not RULE.fullmatch(line):
            continue
        if BY_HAND in lines[max(k - 3, 0) : k - 1]:
            continue
        header = [cell.strip().strip('`') for cell in lines[k - 1].strip('|').split('|')]
        above = lines[:k] if page.parent == RESULTS else lines[max(k - BESIDE, 0) : k]
        named = COMMAND.findall('\n'.join(above))
        if page.parent != RESULTS and not named:
            continue
        yield k, [cell for cell in header if cell], named[-1] if named else None


TABLES = [(page.name, *table) for page in PAGES for table in tables(page)]


def test_the_pages_have_tables():
    assert len(TABLES) > 60


@pytest.mark.parametrize(
    ('page', 'line', 'header', 'module'), TABLES, ids=[f'{t[0]}:{t[1]}' for t in TABLES]
)
def test_the_columns_are_those_that_the_benchmark_prints(page, line, header, module):
    assert module, f'{page}:{line}: no benchmark is named above this table'
    unknown = [cell for cell in header if not is_printed(cell, module)]
    assert not unknown, f'{page}:{line}: `python -m benchmarks {module}` prints no {unknown}'


def test_a_column_that_nobody_prints_is_told():
    assert is_printed('truth ep, ew', 'closed_forms')
    assert is_printed('in 5 together', 'speed_dependence')
    assert not is_printed('truth ep', 'closed_forms')
