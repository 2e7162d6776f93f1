"""The sidebar of the site has the order of the index."""

from __future__ import annotations

from nanorocks_ros.tools.docs_pages.site_index import tables_of_contents


def test_sections_and_bullets_become_tables_of_contents():
    text = (
        '# Pages\n\nSee [this](not/listed.md).\n\n## First\n\n- [A](one/a.md): why\n'
        '- [B](../B.rst)\n- no link\n\n## Empty\n\ntext\n\n## Last\n\n- [C](c.md) and [D](d.md)\n'
    )
    assert tables_of_contents(text, 'docs') == (
        '```{toctree}\n:hidden:\n:caption: First\n\nA </docs/one/a>\nB </B>\n```\n'
        '\n```{toctree}\n:hidden:\n:caption: Last\n\nC </docs/c>\n```\n'
    )
