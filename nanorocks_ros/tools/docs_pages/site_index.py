"""The order of the pages in the site: that of the links of ``docs/README.md``."""

from __future__ import annotations

import posixpath
import re

_BULLET = re.compile(r'^- \[([^\]]*)\]\(([^)#\s]+)\.(?:md|rst)\)', re.MULTILINE)


def tables_of_contents(text: str, folder: str) -> str:
    """A hidden table of contents for each section of an index page.

    Parameters
    ----------
    text : str
        Markdown with sections of the second level, whose bullets begin with a link to a page.
    folder : str
        Where the page lies, from the root.

    Returns
    -------
    str
        Markdown with directives of Sphinx, which becomes the sidebar.
    """
    blocks = []
    for section in text.split('\n## ')[1:]:
        title, _, body = section.partition('\n')
        entries = '\n'.join(
            f'{name} </{posixpath.normpath(posixpath.join(folder, page))}>'
            for name, page in _BULLET.findall(body)
        )
        if entries:
            blocks.append(f'```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n')
    return '\n'.join(blocks)
