"""The call that made a file, for its description.

Tested by ``test/outputs/test_figure_files.py``.
"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

_PROGRAM = 'nanorocks'


def command_line() -> str:
    """The call of the command line as one would type it; empty in a program of somebody else."""
    return shlex.join([_PROGRAM, *sys.argv[1:]]) if program_name() == _PROGRAM else ''


def program_name() -> str:
    """The name of the program, without its folder."""
    return Path(sys.argv[0]).name if sys.argv else ''
