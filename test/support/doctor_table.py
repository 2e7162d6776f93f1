"""The table of faults in docs/start/doctor.md, which tests compare with what the doctor says."""

from __future__ import annotations

import re
from pathlib import Path

_PAGE = Path(__file__).resolve().parent.parent.parent / 'docs/start/doctor.md'
_ROW = re.compile(r'\| ([^|]+) \| `(?:doctor|--graph)` \| ([^|]+) \| ([^|]*)\|')


def documented():
    """What the doctor says and advises, by fault."""
    rows = _ROW.findall(_PAGE.read_text('utf-8'))
    return {fault.replace('`', ''): (said.strip(), advice.strip()) for fault, said, advice in rows}


def assert_documented(fault, status, found, remedy):
    """Compare a finding with the row of a fault."""
    said, advice = documented()[fault]
    for text, pattern in ((f'{status}: {found}', said), (remedy, advice)):
        plain = text.replace('`', '')
        assert re.fullmatch(_as_expression(pattern), plain, re.DOTALL), (text, pattern)


def _as_expression(cell):
    return '.*'.join(re.escape(part) for part in cell.replace('`', '').split('…'))
