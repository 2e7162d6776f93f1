"""Numbers on the pages are those that the command named beside them prints.

A comment ``<!-- printed by: COMMAND -->`` stands before such a block or table. Commands that take
longer than a few seconds are not run here; that they exist is tested in ``test_docs_code.py``.
"""

from __future__ import annotations

from functools import cache

import pytest
from page_code import PAGES, ROOT
from page_runs import not_printed, printed_blocks, run_here

PRINTED = [
    pytest.param(command, block, id=f'{page.relative_to(ROOT)}-{number}')
    for page in PAGES
    for number, (command, block) in enumerate(printed_blocks(page.read_text(encoding='utf-8')))
]


@pytest.fixture(scope='module')
def printed(tmp_path_factory):
    """What a command prints; each is run once."""

    @cache
    def output(command):
        folder = tmp_path_factory.mktemp('printed')
        (folder / 'bags').symlink_to(ROOT / 'bags')
        return run_here(command, folder)

    return output


@pytest.mark.parametrize(('command', 'block'), PRINTED)
def test_a_command_prints_what_the_page_says(command, block, printed):
    assert not_printed(printed(command), block) == '', command


def test_no_mark_is_overlooked():
    marks = sum(
        line.startswith('<!-- printed by: ')
        for page in PAGES
        for line in page.read_text(encoding='utf-8').splitlines()
    )
    assert marks == len(PRINTED) > 5
