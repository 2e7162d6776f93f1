"""Addresses outside the repository stand in one list, and have the form of what they are."""

from __future__ import annotations

import re

from page_code import PAGES, ROOT

LIST = ROOT / 'docs' / 'reference' / 'links.md'
ADDRESS = re.compile(r'https?://[^\s)>\]"\'`,]+')
ARTICLE = re.compile(
    r'(?:doi:|doi\.org/)(\S+?)(?=[.,;:)\]]*(?:[\s)\]\'"|]|$))|(?:arXiv:|abs/)([\w./-]+\d)'
)
DOI = re.compile(r'10\.\d{4,9}/[A-Za-z0-9./()-]*[A-Za-z0-9]')
ARXIV = re.compile(r'\d{4}\.\d{4,5}|[a-z-]+/\d{7}')
# Of this machine, of examples, and names of formats that nobody opens.
LOCAL = re.compile(r'https?://(127\.0\.0\.1|localhost|HOST)')


def articles(text):
    """Numbers of the articles that a text names."""
    return {doi or arxiv for doi, arxiv in ARTICLE.findall(text)}


def addresses(text):
    """Addresses in a text but those of articles."""
    found = {address.rstrip('.') for address in ADDRESS.findall(text)}
    articles_of = ('https://doi.org/', 'https://arxiv.org/')
    return {
        address
        for address in found
        if not address.startswith(articles_of) and not LOCAL.match(address)
    }


def sources():
    """Texts of all pages but the list, and of all code."""
    yield from (page.read_text('utf-8') for page in PAGES if page != LIST)
    yield (ROOT / 'CITATION.cff').read_text('utf-8')
    for folder in ('nanorocks_ros', 'benchmarks', 'test'):
        for path in (ROOT / folder).rglob('*.py'):
            if path.name != 'test_external_links.py':
                yield path.read_text('utf-8')


def test_the_list_has_every_article_and_no_other():
    listed = articles(LIST.read_text('utf-8'))
    assert set.union(*map(articles, sources())) == listed


def test_numbers_of_articles_have_the_form_of_a_doi_or_of_arxiv():
    listed = articles(LIST.read_text('utf-8'))
    assert len(listed) > 15
    assert [name for name in listed if not (DOI.fullmatch(name) or ARXIV.fullmatch(name))] == []


def test_the_list_has_every_address_that_a_page_names():
    named = set.union(*(addresses(page.read_text('utf-8')) for page in PAGES if page != LIST))
    assert named - addresses(LIST.read_text('utf-8')) == set()


def test_the_list_names_no_address_that_nobody_uses():
    texts = '\n'.join(sources())
    assert [name for name in addresses(LIST.read_text('utf-8')) if name not in texts] == []
