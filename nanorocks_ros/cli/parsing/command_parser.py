"""The parser of every command: a short help, a full one, and a hint where a word is misspelt."""

from __future__ import annotations

import argparse
import os
import re
from itertools import pairwise
from shlex import quote
from typing import TYPE_CHECKING, Any, NoReturn

from nanorocks_ros.errors import did_you_mean

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

_ALL = '--help-all'
_MISSING = 'arguments are required'
# Options that take several numbers also take the words behind them.
_NO_NUMBER = re.compile(r"invalid (?:float|int) value: '(.+)'")


class CommandParser(argparse.ArgumentParser):
    """A parser whose ``--help`` shows the everyday options, and ``--help-all`` all of them.

    A wrong call is one line on standard error, with exit code 2. Without arguments, a parser of
    commands prints its help.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        options.setdefault('formatter_class', _Formatter)
        # A help of its own.
        options['add_help'] = False
        super().__init__(*arguments, **options)
        self.description = _as_sentence(self.description or '')
        self._words: Sequence[str] = ()
        self._rare: list[argparse.Action] = []
        self._sections: Mapping[str, Iterable[str]] = {}
        self.add_argument('-h', '--help', action=_Help, help='show the everyday options')
        self.leave_out(self.add_argument(_ALL, action=_Help, help='show all options'))
        self.register('action', 'parsers', _Commands)

    def leave_out(self, *options: argparse.Action | str) -> None:
        """Leave options, or their flags, out of the short help."""
        flags = self._option_string_actions
        self._rare += [flags[item] if isinstance(item, str) else item for item in options]

    def group_commands(self, sections: Mapping[str, Iterable[str]]) -> None:
        """List the commands in the help under titles: title to names of commands."""
        self._sections = sections

    def commands(self) -> dict[str, CommandParser]:
        """Name to parser of each command of this one; empty where it has none."""
        subparsers = [
            action for action in self._actions if isinstance(action, argparse._SubParsersAction)
        ]
        return dict(subparsers[0].choices) if subparsers else {}

    def shown(self) -> list[argparse.Action]:
        """The arguments and options of the short help."""
        return [action for action in self.described() if action not in self._rare]

    def format_help(self) -> str:
        """The short help."""
        flags = [action for action in self.shown() if action.option_strings]
        positional = [action for action in self.shown() if not action.option_strings]
        groups = [('arguments', None, positional), ('options', None, flags)]
        hidden = len(self.described()) - len(self.shown()) - 1
        more = f'{hidden} more options: {self.prog} {_ALL}\n' if hidden else ''
        return self._help(groups, more)

    def format_full_help(self) -> str:
        """The help with all options, in groups."""
        groups = [
            (group.title, group.description, group._group_actions) for group in self._action_groups
        ]
        return self._help(groups, '')

    def format_usage(self) -> str:
        """One line with what is required."""
        required = [item for item in self._actions if item.required or not item.option_strings]
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, required, [])
        return f'{formatter.format_help().rstrip()} [options]\n'

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, after unknown options are refused and missing commands answered by the help."""
        import sys

        words = list(sys.argv[1:] if args is None else args)
        if self.commands() and not words:
            self.print_help()
            self.exit()
        self._check_flags(words)
        self._words = words
        return super().parse_known_args(words, namespace)

    def error(self, message: str) -> NoReturn:
        """Print one line and end with exit code 2."""
        text = ' '.join(message.removeprefix('argument ').split())
        remedy = self._name_behind_numbers(text) or f'see {self.prog} --help'
        hint = '' if '; ' in text else f'; {remedy}'
        self.exit(2, f'nanorocks: {text}{hint}\n')

    def _name_behind_numbers(self, message: str) -> str:
        """The remedy where an option that takes several values took the name of a file, too."""
        if (match := _NO_NUMBER.search(message)) is not None:
            return swallowed_name(match[1])
        if _MISSING not in message:
            return ''
        behind = [
            word
            for before, word in pairwise(self._words)
            if not before.startswith('-') and not word.startswith('-')
        ]
        return next((remedy for word in behind if (remedy := swallowed_name(word))), '')

    def described(self) -> list[argparse.Action]:
        """All arguments and options that have a help."""
        return [action for action in self._actions if action.help is not argparse.SUPPRESS]

    def _help(
        self, groups: Iterable[tuple[str | None, str | None, list[argparse.Action]]], more: str
    ) -> str:
        formatter = self._get_formatter()
        formatter.add_text(self.description)
        for title, text, actions in groups:
            formatter.start_section(title)
            formatter.add_text(text)
            formatter.add_arguments([item for item in actions if item.dest not in self._grouped()])
            formatter.end_section()
        for title, names in self._sections.items():
            formatter.start_section(title)
            formatter.add_arguments(self._listed(names))
            formatter.end_section()
        formatter.add_text(self.epilog)
        parts = self.format_usage(), formatter.format_help(), more
        return '\n'.join(part for part in parts if part)

    def _grouped(self) -> set[str]:
        return {'command'} if self._sections else set()

    def _listed(self, names: Iterable[str]) -> list[argparse.Action]:
        """Names of commands with their help, as the formatter takes them."""
        (commands,) = (
            item for item in self._actions if isinstance(item, argparse._SubParsersAction)
        )
        by_name = {action.dest: action for action in commands._choices_actions}
        return [by_name[name] for name in names]

    def _check_flags(self, words: Sequence[str]) -> None:
        """Refuse options that are none, before anything else is said to be missing."""
        known = [flag for flag in self._option_string_actions if flag.startswith('--')]
        for word in words:
            if word == '--' or (self.commands() and not word.startswith('-')):
                return
            flag = word.partition('=')[0]
            if not flag.startswith('--') or ' ' in word:
                continue
            if not any(name.startswith(flag) for name in known):
                seen = [name for name in known if name not in self._hidden()]
                hint = did_you_mean(flag, seen) or f'see {self.prog} {_ALL}'
                self.exit(2, f'nanorocks: {flag}: no option of {self.prog}; {hint}\n')

    def _hidden(self) -> set[str]:
        return {
            flag
            for flag, action in self._option_string_actions.items()
            if action.help is argparse.SUPPRESS
        }

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a word that is none of the choices, with the nearest of them."""
        choices = action.choices
        if choices is None or value in choices:
            return
        names = [str(choice) for choice in choices]
        if isinstance(action, argparse._SubParsersAction):
            hint = did_you_mean(str(value), names) or f'see {self.prog} --help'
            self.exit(2, f'nanorocks: {value}: no command of {self.prog}; {hint}\n')
        hint = did_you_mean(str(value), names)
        text = f'{value!r} is none of {", ".join(names)}'
        raise argparse.ArgumentError(action, f'{text}; {hint}' if hint else text)


class _Commands(argparse._SubParsersAction):  # type: ignore[type-arg]
    """Commands, whose line in the list is the first line of their own help."""

    def add_parser(self, name: str, **options: Any) -> CommandParser:
        """Add a command."""
        text = options.get('help') or ''
        options.setdefault('description', f'{text[:1].upper()}{text[1:]}.')
        parser: CommandParser = super().add_parser(name, **options)
        return parser


class _Help(argparse._HelpAction):
    """Prints the short or the full help, and ends."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Print and end."""
        if isinstance(parser, CommandParser):
            # Abbreviations of `--help-all` are no abbreviations of `--help`.
            is_full = (option_string or '').startswith('--help-')
            print(parser.format_full_help() if is_full else parser.format_help(), end='')
        parser.exit()


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Names values without a name of their own by what they are."""

    def _get_default_metavar_for_optional(self, action: argparse.Action) -> str:
        if action.type in (int, float):
            return 'N' if action.type is int else 'NUMBER'
        return action.dest.upper()

    def _get_default_metavar_for_positional(self, action: argparse.Action) -> str:
        return action.dest.upper()


def offer(action: argparse.Action, words: Sequence[str]) -> None:
    """What a shell offers for an option that checks its value itself; nothing without words."""
    action.words = tuple(words)  # type: ignore[attr-defined]


def swallowed_name(word: str) -> str:
    """The remedy where an option took the name of a file as a value; '' if it is no file."""
    return f'write {quote(word)} before the options' if os.path.exists(word) else ''


def _as_sentence(text: str) -> str:
    """A text that begins with a capital letter and ends with a full stop."""
    return f'{text[:1].upper()}{text[1:].removesuffix(".")}.' if text else ''
