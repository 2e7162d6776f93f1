"""Every table of the documentation has the columns that the benchmark named above it prints today.

The benchmarks take minutes to days; their headers are compared without running them.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from benchmarks import documented
from benchmarks.documented import documented_tables

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / 'docs').rglob('*.md'))


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


TABLES = [
    (page.name, table.line, table.columns, table.benchmark)
    for page in PAGES
    for table in documented_tables(page)
    if table.is_beside
]


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


PRINTED = """
## closed_forms: Rates.

| tray | rate |
| --- | --- |
| 1 | 0.3 |
| 3 | 0.4 |

| tray | share |
| --- | --- |
| 1 | 0.5 |
| 3 | 0.6 |
| 5 | 0.7 |

| other |
| --- |
| 1 |

| tray | rate |
| --- | --- |
"""
PAGE = """# Rates

`python -m benchmarks closed_forms`:

| tray | `rate` |
| --- | --- |
| 1 | 0.2 |
| 3 | 0.4 |

| tray | share |
| --- | --- |
| 1 | 0.5 |
| 5 | 0.8 |

They fall.
"""


@pytest.fixture
def page(tmp_path, monkeypatch):
    page = tmp_path / 'docs' / 'rates.md'
    page.parent.mkdir()
    page.write_text(PAGE)
    (tmp_path / 'printed.txt').write_text(PRINTED)
    monkeypatch.setattr(documented, '_DOCS', page.parent)
    return page


def test_rows_that_differ_are_told(page, capsys):
    assert documented.main([str(page.parents[1] / 'printed.txt')]) == 1
    told = capsys.readouterr().out
    assert f'{page.parent.name}/{page.name}:5:' in told
    assert '- | 1 | 0.2 |' in told
    assert '+ | 1 | 0.3 |' in told
    assert '2 tables compared, 2 differ; 1 stand nowhere' in told
    assert page.read_text() == PAGE


def test_printed_rows_replace_those_of_the_page(page):
    output = str(page.parents[1] / 'printed.txt')
    assert documented.main([output, '--renew']) == 0
    assert page.read_text() == PAGE.replace('0.2', '0.3').replace('0.8', '0.7')
    assert documented.main([output]) == 0


def test_an_output_that_is_not_there_is_named(capsys):
    with pytest.raises(SystemExit):
        documented.main(['nowhere.txt'])
    assert 'no file nowhere.txt' in capsys.readouterr().err
