"""How to cite is what CITATION.cff says."""

from __future__ import annotations

from nanorocks_ros import __version__
from nanorocks_ros.tools.docs_pages.citation_page import citation_page


def test_software_and_article_are_cited(root):
    page = citation_page(root / 'CITATION.cff')
    assert f'version = {{{__version__}}}' in page
    assert '@software{nanorocks_ros,' in page
    assert '@article{brisset,' in page
    assert 'author = {J. Brisset and T. Miletich and J. Metzger and A. Rascon' in page
    assert r'journal = {Astronomy \& Astrophysics}' in page
    assert '*Multi-Particle Collisions in Microgravity: ' in page


def test_what_is_not_known_is_left_out(tmp_path):
    path = tmp_path / 'CITATION.cff'
    path.write_text('title: a\ntype: software\nauthors:\n  - name: b\n', encoding='utf-8')
    assert citation_page(path) == (
        '- b, *a*.\n\n```bibtex\n@software{a,\n  author = {b},\n  title = {a},\n}\n```\n'
    )
