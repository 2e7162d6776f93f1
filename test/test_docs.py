"""Names, links and pictures of the documentation."""

from __future__ import annotations

import ast
import dataclasses
import re

import pytest
from page_code import PAGES, ROOT

import nanorocks_ros as nr
from nanorocks_ros import records

SUFFIXES = r'(_error|_errors|_lower|_upper|_68|_[xy]|_[12])*$'
LINK = re.compile(r'(?<!`)\[[^\]]*\]\(([^)\s]+)\)')

PACKAGE = ROOT / 'nanorocks_ros'
# What makes the pages names them; it runs in the source tree alone.
MAKERS = (PACKAGE / 'tools' / 'docs_pages', PACKAGE / 'nodes' / 'reference.py')


def glossary():
    """The names in the first column of the tables."""
    text = (ROOT / 'docs/reference/glossary.md').read_text(encoding='utf-8')
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('| `')]
    return {name for row in rows for name in re.findall(r'`([^`]+)`', row)}


def root_of(name):
    """A field name without the prefixes and suffixes that the glossary explains once."""
    return re.sub(SUFFIXES, '', re.sub(r'^(first|second)_species_', '', name))


def test_every_field_of_a_record_is_in_the_glossary():
    names = glossary()
    kinds = [kind for kind in vars(records).values() if dataclasses.is_dataclass(kind)]
    used = {field.name for kind in kinds for field in dataclasses.fields(kind)}
    assert len(kinds) > 10
    assert {name for name in used if name not in names and root_of(name) not in names} == set()


def test_every_name_in_the_glossary_is_used():
    code = '\n'.join(
        path.read_text(encoding='utf-8') for path in (ROOT / 'nanorocks_ros').rglob('*.py')
    )
    words = set(re.findall(r'\w+', code))
    assert {name for name in glossary() if ' ' not in name} - words == set()


def anchors(page):
    """The anchors of the headings of a page."""
    lines = page.read_text(encoding='utf-8').splitlines()
    headings = [line.lstrip('#').strip().lower() for line in lines if line.startswith('#')]
    return {re.sub(r'[^\w\- ]', '', heading).replace(' ', '-') for heading in headings}


def told_texts(path):
    """The texts of a module that users may see: all but docstrings and comments."""
    tree = ast.parse(path.read_text(encoding='utf-8'))
    bodies = [
        node.body for node in ast.walk(tree) if isinstance(getattr(node, 'body', None), list)
    ]
    # A docstring, also of a constant, is an expression of its own.
    unseen = {id(line.value) for body in bodies for line in body if isinstance(line, ast.Expr)}
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in unseen
    ]


def test_messages_name_no_page_which_an_installation_lacks():
    modules = [
        path
        for path in PACKAGE.rglob('*.py')
        if not any(path.is_relative_to(maker) for maker in MAKERS)
    ]
    texts = [(path, text) for path in modules for text in told_texts(path)]
    texts += [(nr, getattr(nr, name).__doc__ or '') for name in nr.__all__]
    installed = [
        *PACKAGE.rglob('*.yaml'),
        *(ROOT / 'config').iterdir(),
        *(ROOT / 'launch').iterdir(),
    ]
    texts += [(path, path.read_text(encoding='utf-8')) for path in installed if path.is_file()]
    assert len(texts) > 1000
    page = re.compile(r'\bdocs/[\w/]*\w\.md|\b[a-z_]+\.md\b')
    assert [(str(where), text) for where, text in texts if page.search(text)] == []


@pytest.mark.parametrize('page', PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_between_pages_exist(page):
    dead = []
    for target in LINK.findall(page.read_text(encoding='utf-8')):
        path, _, anchor = target.partition('#')
        if '://' in target:
            continue
        target_path = (page.parent / path).resolve() if path else page
        if not target_path.exists() or (anchor and anchor not in anchors(target_path)):
            dead.append(target)
    assert dead == []


def test_every_page_is_in_the_index():
    index = (ROOT / 'docs/README.md').read_text(encoding='utf-8')
    named = {target.partition('#')[0] for target in LINK.findall(index)}
    pages = {str(path.relative_to(ROOT / 'docs')) for path in (ROOT / 'docs').rglob('*.md')}
    records = {name for name in pages if name.startswith('develop/decisions/0')}
    assert pages - records - {'README.md'} - named == set()


def test_every_decision_is_in_its_list():
    folder = ROOT / 'docs/develop/decisions'
    named = set(LINK.findall((folder / 'README.md').read_text(encoding='utf-8')))
    assert {path.name for path in folder.glob('*.md')} - {'README.md'} - named == set()


def test_pages_that_code_names_exist():
    mention = re.compile(r'docs/[\w/-]+\.(?:md|png)')
    sources = [ROOT / 'CHANGELOG.rst', *(ROOT / 'config').glob('*.yaml')]
    for folder in ('nanorocks_ros', 'benchmarks', 'test'):
        sources += [*(ROOT / folder).rglob('*.py'), *(ROOT / folder).rglob('*.yaml')]
    missing = {
        f'{path.relative_to(ROOT)}: {name}'
        for path in sources
        for name in mention.findall(path.read_text(encoding='utf-8'))
        if not (ROOT / name).exists()
    }
    assert missing == set()
