"""Blocks of a recipe in CONTRIBUTING.md, applied to a copy of the source tree."""

from __future__ import annotations

import os
import re
import subprocess
import sys


def section_of(text, title):
    """The lines under a heading of the second level, up to the next one."""
    _, _, rest = text.partition(f'\n## {title}\n')
    assert rest, f'no section {title!r}'
    return rest.partition('\n## ')[0]


def code_blocks(text, languages):
    """The contents of the fenced blocks in these languages, in order."""
    fence = rf'^```(?:{"|".join(languages)})\n(.*?)^```$'
    return re.findall(fence, text, re.MULTILINE | re.DOTALL)


def with_added_lines(text, lines):
    """A text with the lines marked ``+``, at the one place that has the lines around them."""
    before = ''.join(f'{line[1:]}\n' for line in lines if not line.startswith('+'))
    after = ''.join(f'{line[1:]}\n' for line in lines)
    assert text.count(before) == 1, f'{text.count(before)} places for:\n{before}'
    return text.replace(before, after)


def apply_block(block, tree):
    """Write the new file of a block ``# path``, or change the file of a block ``+++ path``."""
    first, *lines = block.splitlines()
    path = tree / re.sub(r'^(\+\+\+|#) ', '', first)
    path.parent.mkdir(parents=True, exist_ok=True)
    if first.startswith('+++'):
        text = with_added_lines(path.read_text(encoding='utf-8'), lines)
    else:
        assert not path.exists(), path
        text = '\n'.join(lines) + '\n'
    path.write_text(text, encoding='utf-8')


def run_python(tree, *arguments):
    """Standard output of Python on the copy, which has to end with code 0."""
    environment = {**os.environ, 'PYTHONPATH': str(tree), 'OPENBLAS_NUM_THREADS': '1'}
    finished = subprocess.run(
        [sys.executable, *arguments],
        cwd=tree,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout
