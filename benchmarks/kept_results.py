"""Where films and results are kept, which are costly: a second run makes only missing ones."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

FOLDER = 'NANOROCKS_FILMS'
"""Environment variable with the folder; default: in the temporary directory."""


def folder() -> Path:
    """Folder of films and results."""
    default = Path(tempfile.gettempdir()) / 'nanorocks_films'
    path = Path(os.environ.get(FOLDER, default))
    path.mkdir(parents=True, exist_ok=True)
    return path
