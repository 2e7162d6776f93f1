"""Notices of commands: one line on the terminal, whatever is in the names of files and topics.

Tested by ``test/cli/test_main.py``.
"""

from __future__ import annotations

import sys

from nanorocks_ros.outputs.safe_text import printable


def tell(notice: str) -> None:
    """Print a notice or an error, without control sequences."""
    print(f'nanorocks: {printable(notice)}', file=sys.stderr)
