"""How to cite, from ``CITATION.cff``, which is the only place where it stands."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

if TYPE_CHECKING:
    from pathlib import Path

_AND = '\\&'


def citation_page(path: Path) -> str:
    """The software and its references, as sentences and as BibTeX.

    Parameters
    ----------
    path : Path
        ``CITATION.cff``

    Returns
    -------
    str
        Markdown.
    """
    cited = yaml.safe_load(path.read_text(encoding='utf-8'))
    works = [cited, *cited.get('references', [])]
    entries = '\n\n'.join(map(_bibtex, works))
    sentences = '\n'.join(f'- {_sentence(work)}' for work in works)
    return f'{sentences}\n\n```bibtex\n{entries}\n```\n'


def _author(author: dict[str, Any]) -> str:
    if 'name' in author:
        return f'{author["name"]}'
    return f'{author["given-names"]} {author["family-names"]}'


def _fields(work: dict[str, Any]) -> dict[str, str]:
    """What is known of a work, by the names of BibTeX."""
    named: dict[str, str] = {
        name: str(work[name])
        for name in ('title', 'journal', 'version', 'doi', 'url', 'year')
        if name in work
    }
    return {'author': ' and '.join(map(_author, work['authors'])), **named}


def _bibtex(work: dict[str, Any]) -> str:
    kind = 'article' if work['type'] == 'article' else 'software'
    first = work['authors'][0]
    key = first.get('family-names', work['title']).lower()
    lines = [
        f'  {name} = {{{value.replace("&", _AND)}}},' for name, value in _fields(work).items()
    ]
    return '\n'.join([f'@{kind}{{{key},', *lines, '}'])


def _sentence(work: dict[str, Any]) -> str:
    names = ', '.join(map(_author, work['authors']))
    rest = [str(work[name]) for name in ('journal', 'version', 'year') if name in work]
    return ', '.join([names, f'*{work["title"]}*', *rest]) + '.'
