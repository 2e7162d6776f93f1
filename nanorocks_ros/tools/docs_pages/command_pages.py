"""The reference of the command line, read from the parser; the site has it, git does not."""

from __future__ import annotations

import argparse
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.tools.docs_pages.wire_pages import table

if TYPE_CHECKING:
    from collections.abc import Iterator

_SHARED_BY = 4
"""An option that so many commands have, with the same words, is explained once."""
_SUBPARSERS = argparse._SubParsersAction


@dataclass(frozen=True, slots=True)
class OptionRow:
    """An option or an argument of a command, as the page prints it.

    Parameters
    ----------
    call : str
        ``-o, --output OUTPUT``
    meaning : str
    is_required : bool
    """

    call: str
    meaning: str
    is_required: bool


@dataclass(frozen=True, slots=True)
class Command:
    """A command that has no commands below it.

    Parameters
    ----------
    parser : ArgumentParser
    summary : str
        Its line in the list of commands.
    """

    parser: argparse.ArgumentParser
    summary: str

    @property
    def name(self) -> str:
        """The words that call it."""
        return self.parser.prog


def commands_of(parser: argparse.ArgumentParser, summary: str = '') -> Iterator[Command]:
    """All commands of a parser that have none below them, in the order of the help."""
    groups = [action for action in parser._actions if isinstance(action, _SUBPARSERS)]
    if not groups:
        yield Command(parser, summary)
    for group in groups:
        summaries = {choice.dest: choice.help or '' for choice in group._choices_actions}
        # A command may have several names; its parser is then met more than once.
        for child, name in {child: name for name, child in group.choices.items()}.items():
            yield from commands_of(child, summaries.get(name, ''))


def option_rows(parser: argparse.ArgumentParser) -> list[OptionRow]:
    """Arguments and options of one command, without those that are hidden and ``--help``."""
    formatter = parser._get_formatter()
    return [
        OptionRow(
            call=_call(action, formatter),
            meaning=formatter._expand_help(action) if action.help else '',
            is_required=bool(action.required),
        )
        for action in parser._actions
        if action.help != argparse.SUPPRESS and '--help' not in action.option_strings
    ]


def _call(action: argparse.Action, formatter: argparse.HelpFormatter) -> str:
    """How an option is written: names, then its value."""
    default = formatter._get_default_metavar_for_optional(action)
    if not action.option_strings:
        return formatter._format_args(
            action, formatter._get_default_metavar_for_positional(action)
        )
    value = '' if action.nargs == 0 else f' {formatter._format_args(action, default)}'
    return ', '.join(action.option_strings) + value


def command_line_page(parser: argparse.ArgumentParser) -> str:
    """The body of the page: each command with its options, then the options of many commands.

    Parameters
    ----------
    parser : ArgumentParser
        That of the whole command line.

    Returns
    -------
    str
        Markdown, from headings of the second level down.
    """
    commands = list(commands_of(parser))
    rows = {command.name: option_rows(command.parser) for command in commands}
    counts = Counter(row for options in rows.values() for row in options)
    shared = {row for row, count in counts.items() if count >= _SHARED_BY and not row.is_required}
    sections = [_command_section(command, rows[command.name], shared) for command in commands]
    return '\n'.join([*sections, _shared_section(rows, shared)])


def _command_section(command: Command, rows: list[OptionRow], shared: set[OptionRow]) -> str:
    own = [row for row in rows if row not in shared]
    needed = [row.call.split(', ')[-1] for row in rows if row.is_required]
    others = ['[OPTION ...]'] if len(needed) < len(rows) else []
    about = (command.parser.description or command.summary).replace('%(prog)s', command.name)
    call = ' '.join([command.name, *needed, *others])
    lines = [f'## {command.name}', '', escaped(about), '', '```bash', call, '```', '']
    if own:
        lines += [_option_table(own)]
    if len(own) < len(rows):
        count = len(rows) - len(own)
        lines += [f'It also takes {count} of the [shared options](#shared-options).', '']
    if command.parser.epilog:
        epilog = command.parser.epilog.replace('%(prog)s', command.name)
        lines += ['```text', epilog.strip(), '```', '']
    return '\n'.join(lines)


def _option_table(rows: list[OptionRow]) -> str:
    return table(
        ('option', 'meaning'),
        (
            (f'`{row.call}`', escaped(row.meaning) + (' (needed)' if row.is_required else ''))
            for row in rows
        ),
    )


def _shared_section(rows: dict[str, list[OptionRow]], shared: set[OptionRow]) -> str:
    """Options of many commands, each with the commands that take it."""
    commands = {
        row: [name.partition(' ')[2] for name, options in rows.items() if row in options]
        for options in rows.values()
        for row in options
        if row in shared
    }
    text = '## Shared options\n\n[Parameters](parameters.md) lists ranges and units of settings.\n'
    for names in dict.fromkeys(map(tuple, commands.values())):
        listed = ', '.join(f'`{name}`' for name in names)
        same = [row for row, takers in commands.items() if tuple(takers) == names]
        text += f'\n**Of {listed}:**\n\n{_option_table(same)}'
    return text


def escaped(text: str) -> str:
    """A text of the terminal as one paragraph of Markdown."""
    plain = ' '.join(text.split())
    parts = re.split(r'(`[^`]*`)', plain)
    return ''.join(
        part if part.startswith('`') else re.sub(r'([\\*_<>\[\]$])', r'\\\1', part)
        for part in parts
    )
