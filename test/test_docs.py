"""The documentation says what is there: names, links, commands."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from nanorocks_ros import records

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md'), ROOT / 'bags/README.md'])
SUFFIXES = r'(_error|_errors|_lower|_upper|_[xy]|_[12])*$'
LINK = re.compile(r'(?<!`)\[[^\]\n]*\]\(([^)\s]+)\)')


def glossary():
    """The names in the first column of the tables."""
    text = (ROOT / 'docs/glossary.md').read_text(encoding='utf-8')
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('| `')]
    return {name for row in rows for name in re.findall(r'`([^`]+)`', row)}


def root_of(name):
    """A field without what the glossary explains once for all."""
    return re.sub(SUFFIXES, '', re.sub(r'^(first|second)_species_', '', name))


def test_every_field_of_a_record_is_in_the_glossary():
    known = glossary()
    kinds = [kind for kind in vars(records).values() if dataclasses.is_dataclass(kind)]
    used = {field.name for kind in kinds for field in dataclasses.fields(kind)}
    assert len(kinds) > 10
    assert {name for name in used if name not in known and root_of(name) not in known} == set()


def test_every_name_in_the_glossary_is_used():
    code = '\n'.join(
        path.read_text(encoding='utf-8') for path in (ROOT / 'nanorocks_ros').rglob('*.py')
    )
    words = set(re.findall(r'\w+', code))
    assert {name for name in glossary() if ' ' not in name} - words == set()


def anchors(page):
    """What a heading is called in a link."""
    lines = page.read_text(encoding='utf-8').splitlines()
    headings = [line.lstrip('#').strip().lower() for line in lines if line.startswith('#')]
    return {re.sub(r'[^\w\- ]', '', heading).replace(' ', '-') for heading in headings}


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_between_pages_lead_somewhere(page):
    dead = []
    for target in LINK.findall(page.read_text(encoding='utf-8')):
        path, _, anchor = target.partition('#')
        if '://' in target:
            continue
        there = (page.parent / path).resolve() if path else page
        if not there.exists() or (anchor and anchor not in anchors(there)):
            dead.append(target)
    assert dead == []


def test_every_page_is_in_the_index():
    index = (ROOT / 'docs/README.md').read_text(encoding='utf-8')
    named = {target.partition('#')[0] for target in LINK.findall(index)}
    pages = {path.name for path in (ROOT / 'docs').glob('*.md')} - {'README.md'}
    assert pages - named == set()
