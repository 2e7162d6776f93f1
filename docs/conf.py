"""Settings of the documentation site. Its source is the root, so that links work on GitHub, too.

`make site` builds it. README.md is its first page; the order of the others is that of
docs/README.md. A line that ends with `<!-- made for the site: NAME -->` is replaced by
what the code says; on GitHub the rest of the line tells so.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

import nanorocks_ros
from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.tools.docs_pages.citation_page import citation_page
from nanorocks_ros.tools.docs_pages.command_pages import command_line_page
from nanorocks_ros.tools.docs_pages.site_index import tables_of_contents

ROOT = Path(__file__).resolve().parent.parent

project = 'nanorocks_ros'
author = 'The nanorocks_ros developers'
version = release = nanorocks_ros.__version__
extensions = ['myst_parser']
root_doc = 'README'
include_patterns = [
    'README.md',
    'CONTRIBUTING.md',
    'SECURITY.md',
    'CHANGELOG.rst',
    'docs/**',
    'bags/README.md',
    'msg_defs/README.md',
]
exclude_patterns = ['.*', 'build', 'bags/*_results', 'nanorocks_ros', 'msg_defs/nanorocks_msgs']

# As on GitHub.
myst_heading_anchors = 6
myst_fence_as_directive = ['math']
# Options have two dashes, and patterns straight quotes.
smartquotes = False

html_math_renderer = 'mathml'
html_theme = 'furo'
html_title = f'nanorocks_ros {version}'
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
# A page that is opened from a disk may not read others.
html_show_search_summary = False
html_static_path = ['site']
html_css_files = ['site.css']
html_theme_options = {'navigation_with_keys': True}
highlight_language = 'none'

_MADE = {
    'command line': lambda: command_line_page(build_parser()),
    'citation': lambda: citation_page(ROOT / 'CITATION.cff'),
}
_MARK = re.compile(r'^.*<!-- made for the site: (.+) -->$', re.MULTILINE)
_SHELL = re.compile(
    r'(# |export |nanorocks|make |python|ros2 |pip |source |dask |colcon |rosdep |cd )'
)


def _add_made_text(app, name, content):
    """Put what the code says in the place of the marks, and the sidebar below README.md."""
    content[0] = _MARK.sub(lambda mark: _MADE[mark[1]](), content[0])
    if name == root_doc:
        index = (ROOT / 'docs/README.md').read_text(encoding='utf-8')
        content[0] += '\n\n' + tables_of_contents(index, 'docs')
        content[0] += '```{toctree}\n:hidden:\n\n/docs/README\n```\n'
    elif name == 'docs/develop/decisions/README':
        pages = sorted((ROOT / 'docs/develop/decisions').glob('0*.md'))
        listed = '\n'.join(page.stem for page in pages)
        content[0] += f'\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n'


def _colour_commands(app, document):
    """Indented blocks have no language; those that begin with a command are of the shell."""
    for block in document.findall(nodes.literal_block):
        if block.get('language') in (None, 'none', 'default') and _SHELL.match(block.astext()):
            block['language'] = 'bash'


def _mathml(translator, node):
    """A formula as MathML, which browsers render without fonts, scripts or a network."""
    is_display = isinstance(node, nodes.math_block)
    tree = tex2mathml(node.astext(), as_block=is_display)
    translator.body.append(f'<div class="math">{tree}</div>' if is_display else tree)
    raise nodes.SkipNode


def _add_index(app, exception):
    """A site is opened by its index.html."""
    if exception is None and app.builder.format == 'html':
        shutil.copyfile(Path(app.outdir, 'README.html'), Path(app.outdir, 'index.html'))


def setup(app):
    """Connect the above to the build."""
    app.add_html_math_renderer('mathml', (_mathml, None), (_mathml, None))
    app.connect('source-read', _add_made_text)
    app.connect('doctree-read', _colour_commands)
    app.connect('build-finished', _add_index)
