"""The generated pages of the documentation are those that the code generates."""

from __future__ import annotations

from pathlib import Path

import pytest

from nanorocks_ros.study.reference import PAGES

DOCS = Path(__file__).parents[2] / 'docs'


@pytest.mark.parametrize('name', sorted(PAGES))
def test_a_generated_page_is_not_stale(name):
    assert (DOCS / name).read_text(encoding='utf-8') == PAGES[name](), 'run `make docs`'
