"""A command that was killed when its output was complete, and is called again.

Tested by ``test/cli/calibration/test_finished_output.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse


def is_finished(options: argparse.Namespace, specification: str) -> bool:
    """Whether the output is complete and only its parts were left; they are deleted, and told.

    Parameters
    ----------
    options : argparse.Namespace
        With `output` and `force`.
    specification : str
        Of the job, see `Journal`.
    """
    from nanorocks_ros.jobs.resumed_tasks import delete_parts_of_finished

    if options.force or not delete_parts_of_finished(Path(options.output), specification):
        return False
    text = f'nanorocks: {options.output}: was complete; the parts it was made of are deleted'
    print(text, file=sys.stderr)
    return True
