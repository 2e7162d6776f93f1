"""The reference file of the golden check: one line of JSON for each column.

It is kept small. Where all finite values are the same, ``value`` stands for ``mean``, ``min`` and
``max``; where an earlier column of the case holds the same values, they are left out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from benchmarks.golden_columns import Summary

# Case -> file -> column -> summary.
Summaries: TypeAlias = 'dict[str, dict[str, dict[str, Summary]]]'

REFERENCE = Path(__file__).resolve().parent.parent / 'test' / 'golden' / 'golden.json'
_STATISTICS = ('mean', 'min', 'max')
_SIZE = ('rows', 'digest')


def read_reference() -> Summaries:
    """The summaries of all cases, in full; none without a file."""
    if not REFERENCE.exists():
        return {}
    reference: Summaries = json.loads(REFERENCE.read_text(encoding='utf-8'))
    for files in reference.values():
        full: dict[str, Summary] = {}
        for columns in files.values():
            for name, summary in columns.items():
                known = full.setdefault(_key(summary), _expanded(summary))
                columns[name] = known
    return reference


def write_reference(summaries: Summaries) -> None:
    """Write the reference."""
    cases = []
    for case, files in summaries.items():
        written: set[str] = set()
        blocks = []
        for file, columns in files.items():
            lines = []
            for name, summary in columns.items():
                short = _shortened(summary) if _key(summary) not in written else _sized(summary)
                lines.append(f'{json.dumps(name)}: {json.dumps(short, separators=(", ", ":"))}')
                written.add(_key(summary))
            blocks.append(_block(file, lines))
        cases.append(_block(case, blocks))
    REFERENCE.write_text('{\n' + ',\n'.join(cases) + '\n}\n', encoding='utf-8')


def _block(name: str, lines: list[str]) -> str:
    return f'{json.dumps(name)}: {{\n' + ',\n'.join(lines) + '\n}'


def _key(summary: Summary) -> str:
    return f'{summary["rows"]} {summary["digest"]}'


def _sized(summary: Summary) -> Summary:
    return {name: summary[name] for name in _SIZE}


def _shortened(summary: Summary) -> Summary:
    values = {summary.get(name) for name in _STATISTICS}
    if len(values) > 1 or None in values:
        return summary
    return {
        **{name: value for name, value in summary.items() if name not in _STATISTICS},
        'value': summary['mean'],
    }


def _expanded(summary: Summary) -> Summary:
    if 'value' not in summary:
        return summary
    kept = {name: value for name, value in summary.items() if name != 'value'}
    return {**kept, **dict.fromkeys(_STATISTICS, summary['value'])}
