"""What every table says of the run that made it: command, date, versions.

Tested by ``test/studies/results/test_results_provenance.py``.
"""

from __future__ import annotations

import platform
from datetime import datetime, timezone
from functools import cache
from importlib import metadata
from typing import Any

from nanorocks_ros import __version__
from nanorocks_ros.outputs.command_line import command_line

_LIBRARIES = 'numpy', 'scipy', 'numba', 'rosbags', 'av', 'pyarrow'


def run_provenance() -> dict[str, Any]:
    """Command line, date and versions, as values for JSON."""
    return {
        'created': datetime.now(timezone.utc).isoformat(timespec='seconds'),
        'command': command_line(),
        'versions': versions(),
    }


@cache
def versions() -> dict[str, str]:
    """Versions of the package, of Python and of the libraries that make numbers."""
    import cv2

    known = {
        'nanorocks_ros': __version__,
        'python': platform.python_version(),
        'opencv': str(cv2.__version__),
    }
    for name in _LIBRARIES:
        try:
            known[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return known
