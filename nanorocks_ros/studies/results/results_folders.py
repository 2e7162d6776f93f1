"""Folders of results where a film or a recording is wanted: their pictures are no film.

Tested by ``test/cli/test_imported_films.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.tables.table_files import PACKAGE
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK

if TYPE_CHECKING:
    from pathlib import Path


def holds_results(path: Path) -> bool:
    """Whether a path is a folder that a command of this package filled with results."""
    return (path / RESULTS_MARK).is_file() or 'command' in _provenance(path)


def refuse_results(path: Path) -> None:
    """Refuse a folder of results where a film or a recording is wanted.

    Raises
    ------
    RecordingError
        Names the film, as far as the results do.
    """
    if not holds_results(path):
        return
    source = _provenance(path).get('source')
    of_film = f', here {source}' if isinstance(source, str) and source else ''
    raise RecordingError(
        str(path),
        'is a folder of results, not a film or a bag',
        f'name the film or bag that was measured{of_film}',
    )


def _provenance(folder: Path) -> dict[str, Any]:
    """What the description of the tables says of the run that made them; empty without one."""
    path = folder / PACKAGE
    try:
        provenance = read_object(path).get('provenance') if path.is_file() else None
    except (OSError, ValueError, RecordingError):
        return {}
    return provenance if isinstance(provenance, dict) else {}
