"""A report for people: one HTML file that holds its own pictures."""

from __future__ import annotations

import base64
import html
import math
import re
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.command_line import command_line, program_name
from nanorocks_ros.outputs.report_style import STYLE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_TYPES = {'.png': 'image/png', '.jpg': 'image/jpeg'}
# A cell that begins so holds numbers, which stay in one line up to this length.
_NUMBER = re.compile(r'[-+−–]?(\d|–$)')
_LONGEST_NUMBER = 40
_CODE = re.compile(r'`([^`]+)`')
_LETTERS = {' +- ': ' ± ', '/s^2': '/s²', ' um/': ' µm/'}


NOT_KNOWN = '–'
"""What stands in a table for a number that is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table; cells are text.

    Parameters
    ----------
    head : sequence of str
    rows : sequence of sequences of str
    caption : str
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A picture on the disk, to be put into the report.

    Parameters
    ----------
    path : Path
        PNG or JPEG.
    caption : str
        Also what is read where it cannot be seen.
    has_text : bool
        On a phone it is as large as its text needs, and scrolls; without text it fits the page.
    """

    path: Path
    caption: str
    has_text: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """Where the paper errs, and why."""

    text: str


@dataclass(slots=True, kw_only=True)
class Section:
    """A part of the report.

    Parameters
    ----------
    title : str
    parts : list of str, Table, Picture or Erratum
        A str is a paragraph.
    """

    title: str
    parts: list[str | Table | Picture | Erratum] = field(default_factory=list)


def write_report(
    path: Path, title: str, conclusion: str, sections: Sequence[Section], made: str = ''
) -> None:
    """Write the report, complete or not at all: the conclusion first, then how it was made.

    Parameters
    ----------
    path : Path
    title : str
    conclusion : str
        What follows from the report, in one paragraph.
    sections : sequence of Section
    made : str, optional
        Date, version and command; those of now and of this process if not given.

    Raises
    ------
    RecordingError
        When a picture cannot be read or the report not be written.
    """
    contents = ''.join(
        f'<li><a href="#s{number}">{html.escape(section.title)}</a></li>'
        for number, section in enumerate(sections, start=1)
    )
    body = ''.join(
        f'<section id="s{number}"><h2>{number}. {html.escape(section.title)}</h2>'
        + ''.join(_part(part) for part in section.parts)
        + '</section>\n'
        for number, section in enumerate(sections, start=1)
    )
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>\n'
        f'<h1>{html.escape(title)}</h1><p class="conclusion">{html.escape(conclusion)}</p>'
        f'<p class="made">{_with_code(made or made_line())}</p>'
        f'<nav><ol>{contents}</ol></nav>\n{body}</body></html>\n'
    )
    with atomic_file(path) as part:
        part.write_text(page, 'utf-8')


def _part(part: str | Table | Picture | Erratum) -> str:
    if isinstance(part, Table):
        return _table(part)
    if isinstance(part, Picture):
        return _picture(part)
    if isinstance(part, Erratum):
        return f'<p class="errs"><b>Where the paper errs.</b> {html.escape(part.text)}</p>\n'
    return f'<p>{_with_code(_typeset(part))}</p>\n'


def _with_code(text: str) -> str:
    """A text as HTML, with what stands between backticks as code."""
    return _CODE.sub(lambda match: _code(match[1]), html.escape(text))


def _code(command: str) -> str:
    """A command that is broken between its words; a browser breaks options after a hyphen."""
    words = (
        f'<span>{word}</span>' if word.startswith('-') else word for word in command.split(' ')
    )
    return f'<code>{" ".join(words)}</code>'


def _typeset(text: str) -> str:
    """A line of the terminal in the letters of a page."""
    for plain, letters in _LETTERS.items():
        text = text.replace(plain, letters)
    return text


def made_line(command: str = '') -> str:
    """Date, version and command of a report.

    Parameters
    ----------
    command : str, optional
        That of this process if not given.
    """
    told = command or command_line() or program_name()
    date = datetime.now(timezone.utc).strftime('%Y-%m-%d %H:%M UTC')
    return f'Made on {date} with nanorocks_ros {__version__} by `{told}`.'


def _table(table: Table) -> str:
    head = ''.join(f'<th scope="col">{html.escape(cell)}</th>' for cell in table.head)
    rows = ''.join('<tr>' + ''.join(_cell(cell) for cell in row) + '</tr>\n' for row in table.rows)
    # Outside of the part that scrolls: a caption as wide as a wide table is cut on a phone.
    caption = f'<figcaption>{html.escape(table.caption)}</figcaption>' if table.caption else ''
    return (
        f'<figure>{caption}<div class="scroll" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f'<tbody>{rows}</tbody></table></div></figure>\n'
    )


def _cell(cell: str) -> str:
    is_number = len(cell) <= _LONGEST_NUMBER and _NUMBER.match(cell)
    return (
        f'<td class="n">{html.escape(cell)}</td>' if is_number else f'<td>{html.escape(cell)}</td>'
    )


def _picture(picture: Picture) -> str:
    try:
        content = base64.b64encode(picture.path.read_bytes()).decode('ascii')
    except OSError as error:
        raise RecordingError(
            str(picture.path), f'cannot be read ({error.strerror})', 'run the command again'
        ) from error
    kind = _TYPES[picture.path.suffix]
    caption = html.escape(picture.caption)
    kinds = 'picture text' if picture.has_text else 'picture'
    return (
        f'<figure class="{kinds}"><img alt="{caption}" src="data:{kind};base64,{content}">'
        f'<figcaption>{caption}</figcaption></figure>\n'
    )


def number(value: float | None, digits: int = 3, factor: float = 1.0) -> str:
    """A number for a cell of a table; a dash where it is not known."""
    if value is None or not math.isfinite(value):
        return NOT_KNOWN
    text = f'{factor * value:.{digits}g}'
    return f'{float(text):.0f}' if 'e+' in text else text


def with_interval(value: float, interval: tuple[float, float], factor: float = 1.0) -> str:
    """A number and its interval of 95 %, with the digits that a quarter of its length leaves.

    A dash where the number is not known.
    """
    if not math.isfinite(value):
        return NOT_KNOWN
    lower, upper = (factor * end for end in interval)
    # An error of 0.98 has the digits of one of 1.0.
    decimals = _decimals(0.25 * (upper - lower) / 0.95) if upper > lower else 3
    return f'{factor * value:.{decimals}f} [{lower:.{decimals}f}, {upper:.{decimals}f}]'


def _decimals(error: float) -> int:
    """Decimals that two digits of an error leave."""
    return max(0, 1 - math.floor(math.log10(error)))


def with_error(value: float, error: float, factor: float = 1.0) -> str:
    """A number and its standard error, with the digits that two digits of the error leave.

    At most four digits, with smaller errors rounded up to the last. A dash where the number is
    not known; two digits without an error where that is not known; the number alone where the
    error is 0.
    """
    value, error = factor * value, factor * error
    if not math.isfinite(value):
        return NOT_KNOWN
    if not error > 0.0 or math.isinf(error):
        return number(value, 3 if error == 0.0 else 2)
    decimals = _decimals(max(error, 0.01 * abs(value)))
    return f'{value:.{decimals}f} ± {max(error, 10.0**-decimals):.{decimals}f}'
