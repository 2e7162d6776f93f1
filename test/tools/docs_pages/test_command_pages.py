"""The reference of the command line has every command and every option."""

from __future__ import annotations

import argparse

import pytest

from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.tools.docs_pages.command_pages import (
    command_line_page,
    commands_of,
    escaped,
    option_rows,
)


@pytest.fixture(scope='module')
def page():
    return command_line_page(build_parser())


def sections(page):
    return {part.partition('\n')[0]: part for part in page.split('## ')[1:]}


def test_every_command_has_a_section(page):
    named = {name for name in sections(page) if name.startswith('nanorocks ')}
    assert named == {command.name for command in commands_of(build_parser())}
    assert len(named) > 20
    assert 'nanorocks figure packing' in sections(page)


def test_every_option_is_on_the_page(page):
    parts = sections(page)
    for command in commands_of(build_parser()):
        own, shared = parts[command.name], parts['Shared options']
        for row in option_rows(command.parser):
            call = f'`{row.call.replace("|", chr(92) + "|")}`'
            assert call in own or call in shared, (command.name, row.call)


def small_parser():
    parser = argparse.ArgumentParser(prog='tool')
    commands = parser.add_subparsers()
    for name in ('a', 'b', 'c', 'd'):
        command = commands.add_parser(name, help=f'does {name}')
        command.add_argument('--size', type=float, default=2.0, help='in mm; default %(default)s')
        command.add_argument('--hidden', help=argparse.SUPPRESS)
    command.add_argument('-o', '--output', required=True, help='a file')
    command.add_argument('film', nargs='+', help='read 100 %% of it')
    return parser


def test_what_many_commands_share_is_explained_once():
    page = command_line_page(small_parser())
    assert page.count('| `--size SIZE` | in mm; default 2.0 |') == 1
    assert '**Of `a`, `b`, `c`, `d`:**' in page
    assert 'hidden' not in page


def test_a_command_shows_what_it_needs():
    part = sections(command_line_page(small_parser()))['tool d']
    assert 'tool d --output OUTPUT film [film ...] [OPTION ...]' in part
    assert '| `-o, --output OUTPUT` | a file (needed) |' in part
    assert 'read 100 % of it' in part
    assert 'does d' in part


def test_signs_of_markdown_in_help_are_no_markup():
    assert escaped('a *b* <c>\n  [d] `e_f`') == r'a \*b\* \<c\> \[d\] `e_f`'
