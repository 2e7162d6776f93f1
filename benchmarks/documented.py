"""Compare the tables of the documentation with what benchmarks printed, and renew them.

    python -m benchmarks ranks valley > printed.txt
    python -m benchmarks documented printed.txt [--renew]

A table of a page that names a benchmark belongs to the table with the same columns that this one
printed, or to some of its rows. Rows that differ are listed, those of the page before those
printed; ``--renew`` writes the printed ones. The sentences around a table stay: read them.
"""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from itertools import takewhile, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

_DOCS = Path(__file__).parents[1] / 'docs'
# Pages of results. On the other pages the command is named beside its table.
_RESULTS = _DOCS / 'validation'
_BESIDE = 8
_COMMAND = re.compile(r'python -m\s+benchmarks[. ](\w+)')
_HEADING = re.compile(r'## (\w+): ')
_RULE = re.compile(r'\|( *:?-+:? *\|)+$')
_BY_HAND = '<!-- table by hand -->'


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table in Markdown.

    Parameters
    ----------
    source : Path
        A page, or the output of benchmarks.
    line : int
        Number of the rule below its header, counted from 0.
    columns : tuple of str
    rows : tuple of str
        Lines of the source.
    benchmark : str or None
        The one that is named last above it; None where none is.
    is_beside : bool
        Whether that stands beside it, or the page has results alone.
    """

    source: Path
    line: int
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    benchmark: str | None
    is_beside: bool = True


def documented_tables(page: Path) -> Iterator[Table]:
    """The tables of a page that no hand made.

    Parameters
    ----------
    page : Path
        In ``docs/``.
    """
    lines = page.read_text(encoding='utf-8').splitlines()
    for k in _rules(lines):
        if _BY_HAND in lines[max(k - 3, 0) : k - 1]:
            continue
        named = _COMMAND.findall('\n'.join(lines[:k]))
        near = _COMMAND.search('\n'.join(lines[max(k - _BESIDE, 0) : k]))
        is_beside = near is not None or page.parent == _RESULTS
        yield _table(page, lines, k, named[-1] if named else None, is_beside)


def printed_tables(output: Path) -> Iterator[Table]:
    """The tables with rows that benchmarks printed, each below the heading of its own."""
    lines = output.read_text(encoding='utf-8').splitlines()
    for k in _rules(lines):
        headings = _HEADING.findall('\n'.join(lines[:k]))
        table = _table(output, lines, k, headings[-1] if headings else None)
        if table.rows:
            yield table


def main(arguments: Sequence[str]) -> int:
    """Compare outputs with all pages; the exit status is 1 where something differs."""
    parser = argparse.ArgumentParser(
        prog='python -m benchmarks documented',
        description='Compare the tables of the documentation with what benchmarks printed.',
    )
    parser.add_argument('outputs', nargs='+', type=Path, metavar='OUTPUT')
    parser.add_argument('--renew', action='store_true', help='write the printed rows')
    options = parser.parse_args(arguments)
    missing = [str(output) for output in options.outputs if not output.is_file()]
    if missing:
        parser.error(f'no file {", ".join(missing)}; print it: python -m benchmarks NAME > OUTPUT')
    printed = [table for output in options.outputs for table in printed_tables(output)]
    pairs = list(paired(printed, sorted(_DOCS.rglob('*.md'))))
    changed = [(old, rows) for old, new in pairs if (rows := shown_rows(old, new)) != old.rows]
    for old, rows in changed:
        print(f'{old.source.relative_to(_DOCS.parent)}:{old.line}:')
        for before, now in zip_longest(old.rows, rows, fillvalue='(no row)'):
            if before != now:
                print(f'  - {before}\n  + {now}')
    if options.renew:
        # From below, so that the numbers of the lines above stay.
        for old, rows in sorted(changed, key=lambda pair: -pair[0].line):
            renew(old, rows)
    known = {id(new) for _, new in pairs}
    undocumented = sum(id(table) not in known for table in printed)
    print(f'{len(pairs)} tables compared, {len(changed)} differ; {undocumented} stand nowhere')
    return int(bool(changed) and not options.renew)


def paired(printed: Iterable[Table], pages: Iterable[Path]) -> Iterator[tuple[Table, Table]]:
    """Tables of pages, each with the printed one; those of the same columns in their order."""
    waiting: dict[tuple[str, ...], list[Table]] = {}
    for new in printed:
        waiting.setdefault(new.columns, []).append(new)
    for page in pages:
        named = set(_COMMAND.findall(page.read_text(encoding='utf-8')))
        for old in documented_tables(page):
            there = [new for new in waiting.get(old.columns, []) if new.benchmark in named]
            if there:
                waiting[old.columns].remove(there[0])
                yield old, there[0]


def shown_rows(old: Table, new: Table) -> tuple[str, ...]:
    """The printed rows for a table of a page.

    A table that has fewer shows some of them: for each of its rows that which begins with as many
    of the same cells as any, in their order.
    """
    if len(old.rows) >= len(new.rows):
        return new.rows
    left, rows = list(new.rows), []
    for row in old.rows:
        best = max(left, key=lambda printed: _common_cells(row, printed))
        left.remove(best)
        rows.append(best)
    return tuple(rows)


def renew(old: Table, rows: Sequence[str]) -> None:
    """Write rows over those of a table, in its page."""
    lines = old.source.read_text(encoding='utf-8').splitlines()
    first = old.line + 1
    lines[first : first + len(old.rows)] = rows
    old.source.write_text('\n'.join(lines) + '\n', encoding='utf-8')


def _common_cells(a: str, b: str) -> int:
    """How many cells are the same before the first that differs."""
    pairs = zip(a.split('|'), b.split('|'), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


def _rules(lines: Sequence[str]) -> Iterator[int]:
    return (k for k, line in enumerate(lines) if k and _RULE.fullmatch(line))


def _table(
    source: Path,
    lines: Sequence[str],
    rule: int,
    benchmark: str | None,
    is_beside: bool = True,
) -> Table:
    header = [cell.strip().strip('`') for cell in lines[rule - 1].strip('|').split('|')]
    rows = []
    for line in lines[rule + 1 :]:
        if not line.startswith('|'):
            break
        rows.append(line)
    return Table(
        source=source,
        line=rule,
        columns=tuple(cell for cell in header if cell),
        rows=tuple(rows),
        benchmark=benchmark,
        is_beside=is_beside,
    )
