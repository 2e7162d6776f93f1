"""A report for people: one HTML file that holds its own pictures."""

from __future__ import annotations

import base64
import html
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import atomic_file

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_TYPES = {'.png': 'image/png', '.jpg': 'image/jpeg'}
_STYLE = """\
:root { color-scheme: light dark; --line: #8884; --soft: #8882; --link: #1f6feb; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
h2, nav { border-top: 1px solid var(--line); padding-top: 1rem; }
nav ol { columns: 2 18rem; } a { color: var(--link); }
figure { margin: 1rem 0; } figure img { max-width: 100%; height: auto; background: #fff; }
figcaption, caption { color: #777; font-size: .92rem; text-align: left; padding: .3rem 0; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; margin: 1rem 0; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; }
th { background: var(--soft); } td { font-variant-numeric: tabular-nums; }
.errs { border-left: 4px solid #c23b22; padding-left: .8rem; }
"""


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
    """

    path: Path
    caption: str


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


def write_report(path: Path, title: str, summary: str, sections: Sequence[Section]) -> None:
    """Write the report, complete or not at all.

    Parameters
    ----------
    path : Path
    title, summary : str
    sections : sequence of Section

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
        f'<title>{html.escape(title)}</title><style>{_STYLE}</style></head><body>\n'
        f'<h1>{html.escape(title)}</h1><p>{html.escape(summary)}</p>'
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
    return f'<p>{html.escape(part)}</p>\n'


def _table(table: Table) -> str:
    head = ''.join(f'<th scope="col">{html.escape(cell)}</th>' for cell in table.head)
    rows = ''.join(
        '<tr>' + ''.join(f'<td>{html.escape(cell)}</td>' for cell in row) + '</tr>\n'
        for row in table.rows
    )
    caption = f'<caption>{html.escape(table.caption)}</caption>' if table.caption else ''
    return (
        f'<div class="table"><table>{caption}<thead><tr>{head}</tr></thead>'
        f'<tbody>{rows}</tbody></table></div>\n'
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
    return (
        f'<figure><img alt="{caption}" src="data:{kind};base64,{content}">'
        f'<figcaption>{caption}</figcaption></figure>\n'
    )


def number(value: float | None, digits: int = 3, factor: float = 1.0) -> str:
    """A number for a cell of a table; a dash where it is not known."""
    if value is None or not math.isfinite(value):
        return '–'
    text = f'{factor * value:.{digits}g}'
    return f'{float(text):.0f}' if 'e+' in text else text


def with_interval(value: float, interval: tuple[float, float], factor: float = 1.0) -> str:
    """A number and its interval of 95 %, with the digits that a quarter of its length leaves.

    A dash where the number is not known.
    """
    if not math.isfinite(value):
        return '–'
    lower, upper = (factor * end for end in interval)
    decimals = _decimals(0.25 * (upper - lower)) if upper > lower else 3
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
        return '–'
    if not error > 0.0 or math.isinf(error):
        return number(value, 3 if error == 0.0 else 2)
    decimals = _decimals(max(error, 0.01 * abs(value)))
    return f'{value:.{decimals}f} ± {max(error, 10.0**-decimals):.{decimals}f}'
