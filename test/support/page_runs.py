"""Blocks of a page, run in a folder, and what they print, compared with the page."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

from page_code import ROOT, blocks, calls

from nanorocks_ros.cli.main import main

PATIENCE_S = 300
NUMBER = re.compile(r'[-+]?\d+(?:\.(\d+))?')
# A number may differ by so many units of its last digit: processors round differently.
UNITS = 2


def run_shell(command, folder):
    """Standard output and error of a command, which has to end with code 0."""
    environment = {
        **os.environ,
        'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}',
        'PYTHONPATH': str(ROOT),
        'OPENBLAS_NUM_THREADS': '1',
    }
    finished = subprocess.run(
        ['bash', '-e', '-o', 'pipefail', '-c', command],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE_S,
    )
    assert finished.returncode == 0, f'{command}{finished.stdout}'
    return finished.stdout


def run_here(command, folder):
    """What commands joined by ``&&`` print; those of this package without a new process."""
    return ''.join(
        _run_main(words[1:], folder) if words[0] == 'nanorocks' else run_shell(part, folder)
        for part in command.split(' && ')
        for words in [shlex.split(part)]
    )


def _run_main(arguments, folder):
    """Standard output and error of the command `nanorocks`, which has to end with code 0."""
    said = io.StringIO()
    with (
        _inside(folder),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
    ):
        code = main(arguments)
    assert code == 0, f'{arguments}{said.getvalue()}'
    return said.getvalue()


def same_word(printed, stated):
    """Whether words are the same; numbers with a point may differ in their last digit."""
    if printed == stated:
        return True
    if NUMBER.sub('#', printed) != NUMBER.sub('#', stated):
        return False
    pairs = zip(NUMBER.finditer(printed), NUMBER.finditer(stated), strict=True)
    return all(_close(one[0], other[0], other[1]) for one, other in pairs)


def _close(printed, stated, decimals):
    if decimals is None or len(printed.partition('.')[2]) != len(decimals):
        return printed == stated
    unit = Fraction(1, 10 ** len(decimals))
    return abs(Fraction(printed) - Fraction(stated)) <= UNITS * unit


def not_printed(output, stated):
    """What a page states and a command does not print, in this order; '' if nothing.

    A line ``...`` stands for any lines, and line breaks for spaces.
    """
    words, place = output.split(), 0
    for part in re.split(r'^\.\.\.$', stated, flags=re.MULTILINE):
        sought = part.split()
        starts = range(place, len(words) - len(sought) + 1)
        found = next(
            (k for k in starts if all(map(same_word, words[k : k + len(sought)], sought))), None
        )
        if found is None:
            return part.strip()
        place = found + len(sought)
    return ''


def run_page(text, folder):
    """Run the blocks of a page in order, and return (what was not printed as stated, runs)."""
    wrong, runs, output = [], 0, ''
    names = {}
    for block in blocks(text):
        if block.mark == 'prints':
            wrong += [part for part in [not_printed(output, block.text)] if part]
        elif block.mark:
            continue
        elif block.language == 'python':
            output, runs = _run_python(block.text, names, folder), runs + 1
        elif block.language in ('', 'bash'):
            output, runs = run_here(' && '.join(calls(block.text)), folder), runs + 1
    return wrong, runs


def _run_python(code, names, folder):
    """What a block of Python prints, run in a folder with the names of the blocks before it."""
    said = io.StringIO()
    with _inside(folder), contextlib.redirect_stdout(said):
        exec(code, names)
    return said.getvalue()


@contextlib.contextmanager
def _inside(folder):
    """The folder as the current one; ``contextlib.chdir`` came with Python 3.11."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def printed_blocks(text):
    """What a page says that commands print: (command, block or table)."""
    return [
        (found['command'], found['block'] or found['table'])
        for found in re.finditer(
            r'^<!-- printed by: (?P<command>.+) -->\n\n'
            r'(?:```text\n(?P<block>(?:.*\n)*?)```\n|(?P<table>(?:\|.*\n)+))',
            text,
            re.MULTILINE,
        )
    ]
