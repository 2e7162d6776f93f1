"""The tutorial works as it stands, and its commands print what it says."""

from __future__ import annotations

import re

import pytest
from page_code import ROOT
from page_runs import not_printed, run_page, same_word


def test_the_tutorial_does_and_prints_what_it_says(tmp_path):
    pytest.importorskip('pandas', reason='the extra dev has pandas')
    page = (ROOT / 'docs/start/tutorial.md').read_text(encoding='utf-8')
    wrong, runs = run_page(page, tmp_path)
    assert wrong == []
    assert runs == 6
    for name in ('film.avi', 'mine.png', 'results/report.html', 'decay.png'):
        assert (tmp_path / name).stat().st_size > 1000
    report = (tmp_path / 'results/report.html').read_text(encoding='utf-8')
    conclusion = report.partition('class="conclusion">')[2].partition('</p>')[0]
    # What the page says under "Read the numbers elsewhere": the restitution to quote comes first.
    printed = re.search(r'^0\.\d{3} \[0\.\d{3}, 0\.\d{3}\]$', page, re.MULTILINE)[0]
    assert conclusion.startswith(f'Tray 1: beads {printed} (95 %)')
    assert conclusion.index('from decay and contacts together') < conclusion.index('alone')


@pytest.mark.parametrize(
    ('printed', 'stated', 'is_same'),
    [
        ('0.8798', '0.8798', True),
        ('[0.8798,', '[0.8800,', True),
        ('0.8798', '0.8803', False),
        ('0.88', '0.8798', False),
        ('51', '52', False),
        ('-0.01', '0.01', True),
        ('beads', 'walls', False),
    ],
)
def test_numbers_are_compared_to_their_last_digit(printed, stated, is_same):
    assert same_word(printed, stated) == is_same


def test_what_is_stated_must_be_printed_in_its_order():
    output = 'first line\nsecond 1.234 line\nthird'
    assert not_printed(output, 'first line\n...\nthird\n') == ''
    assert not_printed(output, 'second\n1.235 line') == ''
    assert not_printed(output, 'third\n...\nfirst') == 'first'
    assert not_printed(output, 'second 1.24 line') == 'second 1.24 line'
