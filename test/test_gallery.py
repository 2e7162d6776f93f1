"""The gallery has every picture, its command, and the page that explains it."""

from __future__ import annotations

import re

import pytest
from page_code import ROOT, blocks

GALLERY = ROOT / 'docs/gallery.md'
ENTRIES = re.split(r'^### ', GALLERY.read_text(encoding='utf-8'), flags=re.MULTILINE)[1:]
PICTURE = re.compile(r'!\[([^\]]+)\]\(pictures/([\w.]+)\)')
PAGE = re.compile(r'\]\(([\w/]+\.md)\)')


def test_every_picture_is_in_the_gallery_once():
    shown = [PICTURE.search(entry)[2] for entry in ENTRIES]
    assert sorted(shown) == sorted(path.name for path in (ROOT / 'docs/pictures').iterdir())


@pytest.mark.parametrize('entry', ENTRIES, ids=lambda entry: entry.partition('\n')[0])
def test_a_picture_has_its_command_and_the_page_that_shows_it(entry):
    commands = [line for block in blocks(entry) for line in block.text.splitlines()]
    assert commands
    assert all(re.match(r'(nanorocks|python -m|make) ', line) for line in commands)
    name = PICTURE.search(entry)[2]
    pages = [ROOT / 'docs' / page for page in PAGE.findall(entry)]
    showing = [page for page in pages if f'pictures/{name}' in page.read_text(encoding='utf-8')]
    assert showing or name == 'demo.png', f'{name} is on none of {pages}'
