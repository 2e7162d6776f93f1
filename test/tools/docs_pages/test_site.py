"""The site is built without a warning, needs no network, and can be searched."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import pytest

pytest.importorskip('sphinx', reason='the extra docs builds the site')
pytest.importorskip('myst_parser', reason='the extra docs builds the site')
pytest.importorskip('furo', reason='the extra docs builds the site')

# What a page loads by itself; a link is followed only by a reader.
LOADED = {'img': 'src', 'script': 'src', 'link': 'href', 'iframe': 'src', 'source': 'src'}


def build(root, folder):
    return subprocess.run(
        [sys.executable, '-m', 'nanorocks_ros.tools.docs_pages.site', str(root), str(folder)],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=600,
    )


@pytest.fixture(scope='module')
def site(root, tmp_path_factory):
    folder = tmp_path_factory.mktemp('site') / 'html'
    finished = build(root, folder)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    print(finished.stdout)
    return folder


class Loads(HTMLParser):
    """Collects what a page loads, and the headings it has."""

    def __init__(self):
        super().__init__()
        self.loaded = []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if given.get('rel') in ('canonical', 'search', 'next', 'prev', 'index'):
            return
        if tag in LOADED and given.get(LOADED[tag]):
            self.loaded.append(given[LOADED[tag]])


def test_every_page_of_the_index_is_in_the_site(site, root):
    pages = {path.relative_to(site).with_suffix('') for path in site.rglob('*.html')}
    written = {
        path.relative_to(root).with_suffix('')
        for path in [*(root / 'docs').rglob('*.md'), root / 'CONTRIBUTING.md']
    }
    assert written - pages == set()
    assert (site / 'index.html').read_bytes() == (site / 'README.html').read_bytes()


def test_nothing_is_loaded_from_elsewhere(site):
    pages = list(site.rglob('*.html'))
    assert len(pages) > 70
    for page in pages:
        reader = Loads()
        reader.feed(page.read_text(encoding='utf-8'))
        assert reader.loaded
        for address in reader.loaded:
            assert not re.match(r'(\w+:)?//', address), (page, address)
            if not address.startswith('data:'):
                assert (page.parent / address.partition('?')[0]).exists(), (page, address)
    for style in site.rglob('*.css'):
        assert not re.search(r'(url\(|@import )["\']?(\w+:)?//', style.read_text('utf-8')), style


def test_formulas_are_mathml(site):
    page = (site / 'docs/method/theory.html').read_text(encoding='utf-8')
    assert page.count('<math') >= 12
    assert '<mfrac>' in page
    assert 'mathjax' not in page.lower()


def test_made_pages_have_their_content(site):
    commands = (site / 'docs/reference/command_line.html').read_text(encoding='utf-8')
    assert '<section id="nanorocks-figure-packing">' in commands
    assert '@article{brisset' in re.sub(r'<[^>]*>', '', (site / 'docs/cite.html').read_text())
    assert 'made for the site' not in commands


@pytest.fixture
def opened(browser, site):
    """Open a page of the site from the disk; what it asks of a network fails the test."""
    context = browser.new_context(viewport={'width': 1400, 'height': 1000})
    page, asked = context.new_page(), []
    page.on('request', lambda request: asked.append(request.url))
    page.set_default_timeout(10_000)

    def go(address):
        page.goto(f'{site.as_uri()}/{address}')
        return page

    yield go
    context.close()
    assert [url for url in asked if not url.startswith(('file:', 'data:'))] == []


def test_the_search_finds_pages_without_a_server(opened):
    page = opened('search.html?q=autocorrelation')
    page.wait_for_selector('#search-results li a')
    assert 'Autocorrelation' in ' '.join(page.locator('#search-results li').all_inner_texts()) or (
        page.locator('#search-results li a[href*="autocorrelation"]').count() > 0
    )


@pytest.mark.parametrize('address', ['index.html', 'docs/method/theory.html', 'docs/gallery.html'])
def test_a_page_fits_a_phone(opened, address):
    page = opened(address)
    page.set_viewport_size({'width': 390, 'height': 844})
    assert page.evaluate('document.documentElement.scrollWidth') <= 390


def test_a_link_to_nowhere_fails_the_build(root, tmp_path):
    copy = tmp_path / 'tree'
    copy.mkdir()
    for name in ('README.md', 'CITATION.cff'):
        shutil.copy(root / name, copy)
    (copy / 'docs').mkdir()
    shutil.copy(root / 'docs/conf.py', copy / 'docs')
    shutil.copytree(root / 'docs/site', copy / 'docs/site')
    (copy / 'docs/README.md').write_text('# A\n\n[b](nowhere.md)\n', encoding='utf-8')
    (copy / 'README.md').write_text('# A\n\n[b](docs/README.md#none)\n', encoding='utf-8')
    finished = build(copy, tmp_path / 'html')
    assert finished.returncode != 0
    assert 'nowhere.md' in finished.stderr
    assert 'none' in finished.stderr
