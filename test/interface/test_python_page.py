"""The page of the public interface, against the interface."""

from __future__ import annotations

import inspect
from pathlib import Path

import nanorocks_ros as nr
from nanorocks_ros.tools.docs_pages.python_page import python_page

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_as_the_docstrings_say():
    page = (ROOT / 'docs/reference/python.md').read_text('utf-8')
    assert page == python_page(), 'run `make docs`'


def test_every_name_and_every_keyword_is_on_the_page():
    page = python_page()
    for name in set(nr.__all__) - {'__version__'}:
        assert f'`{name}`' in page or f'## {name}\n' in page
        value = getattr(nr, name)
        if inspect.isfunction(value):
            for keyword in inspect.signature(value).parameters:
                assert f'{keyword}' in page.partition(f'## {name}\n')[2].partition('\n## ')[0]
    for keyword in nr.FilmDescription.__annotations__:
        assert f'`{keyword} : ' in page


def test_every_row_has_a_meaning():
    rows = [line for line in python_page().splitlines() if line.startswith('| `')]
    assert len(rows) > 40
    assert [row for row in rows if row.rstrip('| ').endswith('`') and row.count('|') == 3] == []
