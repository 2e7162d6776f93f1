"""Code on the pages of the documentation: blocks, their marks, and calls of commands in them.

A block is indented by four spaces or fenced. A line before it may mark it:

``<!-- not run: why -->``
    The tests check its form alone.
``<!-- sketch: what of -->``
    Python that is not complete; the tests check that it parses and that the names it calls exist.
``<!-- goes on -->``, ``<!-- Ctrl-C -->``
    Of the guide: a command that does not end by itself.
``<!-- prints -->``
    The block is printed by the block before it.
"""

from __future__ import annotations

import argparse
import re
import shlex
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    [
        *ROOT.glob('*.md'),
        *(ROOT / 'docs').rglob('*.md'),
        ROOT / 'bags/README.md',
        ROOT / 'msg_defs/README.md',
    ]
)
MARK = re.compile(r'^<!-- (not run: .+|goes on|Ctrl-C|prints|sketch: .+) -->$')
# What stands for a number or a word in a synopsis.
PLACEHOLDERS = {'X': '1', 'Y': '1', 'K': '1', 'N': '1', 'WIDTH': '1', 'HEIGHT': '1'}
_SUBPARSERS = argparse._SubParsersAction


@dataclass(frozen=True)
class Block:
    """A block of code: its mark or '', its language or '', its text."""

    mark: str
    language: str
    text: str


def blocks(text):
    """The blocks of a page, in order; a mark without a block has an empty text."""
    mark, language, lines, found = '', None, [], []
    for line in [*text.splitlines(), '', 'end']:
        if language is not None:
            if line.strip() == '```':
                found.append(Block(mark, language, '\n'.join(lines) + '\n'))
                mark, language, lines = '', None, []
            else:
                lines.append(line)
        elif line.startswith('    ') or (lines and not line):
            lines.append(line[4:])
        else:
            if lines:
                found.append(Block(mark, '', '\n'.join(lines).rstrip() + '\n'))
                mark, lines = '', []
            if line.startswith('```'):
                language = line.strip('`{}')
            elif marked := MARK.match(line):
                mark = marked.group(1)
                if mark == 'Ctrl-C':
                    found.append(Block(mark, '', ''))
                    mark = ''
    return found


def calls(text):
    """Commands of a block, one a line: continued lines joined, without comments and prompts."""
    joined = re.sub(r'\\\n\s*', ' ', re.sub(r'^\s*[A-Z_]+=\S+ ', '', text, flags=re.MULTILINE))
    for line in joined.splitlines():
        call = re.sub(r'(^|\s)#.*$', '', line).strip()
        yield from (part.strip() for part in re.split(r'&&|\s\|\s', call) if part.strip())


def words(call):
    """The words of a call, without redirections; placeholders of numbers are numbers."""
    kept = re.sub(r'\s[12]?>+\s*\S+|(?<=\s)\.\.\.(?=\s|$)|[\[\]]', '', call)
    return [PLACEHOLDERS.get(word, word) for word in shlex.split(kept)]


def inline_code(text):
    """Code within sentences, with line breaks as spaces."""
    prose = re.sub(r'^```.*?^```$', '', text, flags=re.MULTILINE | re.DOTALL)
    prose = '\n'.join(line for line in prose.splitlines() if not line.startswith('    '))
    return [' '.join(code.split()) for code in re.findall(r'`([^`]+)`', prose)]


def parsers(parser):
    """By its words, every parser of a command line, the ones in between, too."""
    found = {parser.prog: parser}
    for action in parser._actions:
        if isinstance(action, _SUBPARSERS):
            for child in action.choices.values():
                found |= parsers(child)
    return found


def options_of(parser):
    """All options of a command line, of whatever command."""
    return {
        option
        for command in parsers(parser).values()
        for action in command._actions
        for option in action.option_strings
    }
