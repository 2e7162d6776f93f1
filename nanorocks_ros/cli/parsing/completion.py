"""``nanorocks completion SHELL``: the script with which a shell completes commands by TAB."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.cli.parsing.command_parser import CommandParser

SHELLS = 'bash', 'zsh'
_EPILOG = """\
For one shell, or for all new ones:

  source <(nanorocks completion bash)
  nanorocks completion bash >~/.local/share/bash-completion/completions/nanorocks
  nanorocks completion zsh >~/.zfunc/_nanorocks     # a folder of your fpath, before compinit

The script does not update itself: make it again after an update of the package.
"""


def add_parser(commands: Any) -> None:
    """Add the command."""
    parser = commands.add_parser(
        'completion', help='print the script that completes commands by TAB', epilog=_EPILOG
    )
    parser.add_argument('shell', choices=SHELLS, help=' or '.join(SHELLS))
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Print the script; the exit code."""
    print(completion_script(options.parser, options.shell))
    return 0


def completion_script(parser: CommandParser, shell: str) -> str:
    """The script of a shell, with all commands, options and choices.

    Parameters
    ----------
    parser : CommandParser
        Its options learn here how they are completed.
    shell : str
        One of `SHELLS`.

    Raises
    ------
    ConfigurationError
        Where shtab, which writes the script, is not installed.
    """
    try:
        import shtab
    except ModuleNotFoundError as error:
        raise ConfigurationError(
            'nanorocks completion', 'needs shtab, which is not installed', 'pip install shtab'
        ) from error
    for action in _arguments(parser):
        words = getattr(action, 'words', None)
        if words:
            action.choices = words
        elif words is None and action.type is None and not action.choices:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    return str(shtab.complete(parser, shell))


def _arguments(parser: CommandParser) -> Iterator[argparse.Action]:
    """Everything of a parser and its commands that takes a value."""
    commands = parser.commands()
    yield from (item for item in parser.described() if item.nargs != 0 and not commands)
    for command in commands.values():
        yield from _arguments(command)
