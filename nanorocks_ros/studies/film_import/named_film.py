"""Checks of what a user names as a film or a bag, with a remedy for whatever else it is.

Tested by ``test/cli/test_imported_films.py``.
"""

from __future__ import annotations

import shlex
from pathlib import Path

from nanorocks_ros.errors import RecordingError, did_you_mean_file
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.recordings.bag.find_bags import find_bags, is_collection, is_recording
from nanorocks_ros.recordings.film.image_folder import IMAGE_SUFFIXES
from nanorocks_ros.studies.film_import.film_cache import is_film
from nanorocks_ros.studies.film_import.find_films import films_in_folder
from nanorocks_ros.studies.results.results_folders import refuse_results

_REMEDY = 'name a video, a folder of images or a bag'
_YAML = frozenset({'.yaml', '.yml'})


def check_film_or_bag(name: str, *, many: bool = False) -> None:
    """Check that a name is of a film or of a bag.

    What cannot be read, is empty or damaged passes: its reader says so.

    Parameters
    ----------
    name : str
    many : bool
        Whether a folder of bags does as well.

    Raises
    ------
    RecordingError
        When nothing is there, or something else.
    """
    path = Path(name)
    try:
        if not path.exists():
            raise RecordingError(name, 'does not exist', did_you_mean_file(path) or _REMEDY)
        refuse_results(path)
        folder = path.is_dir()
        # To look into a pipe would block.
        if not folder and not (path.is_file() and path.stat().st_size):
            return
        if is_recording(path) or is_film(path) or (many and is_collection(path)):
            return
        (_refuse_folder if folder else _refuse_file)(name)
    except OSError:
        return


def _refuse_folder(name: str) -> None:
    """Refuse a folder that is neither a recording nor images."""
    inside = find_bags([name]).bags if is_collection(Path(name)) else []
    inside += films_in_folder(Path(name)).films
    if inside:
        raise RecordingError(
            name,
            f'is a folder of {counted(len(inside), "recording")}',
            f'name one, such as {shlex.quote(str(inside[0]))}',
        )
    raise RecordingError(name, 'is a folder without a recording, video or image', _REMEDY)


def _refuse_file(name: str) -> None:
    """Refuse a file that is neither a video nor a recording."""
    suffix = Path(name).suffix.lower()
    if suffix in IMAGE_SUFFIXES:
        raise RecordingError(
            name, 'is one image, not a film', 'name a video, or the folder of all its images'
        )
    remedy = f'{_REMEDY}; a file of trays is given by --trays-file' if suffix in _YAML else _REMEDY
    raise RecordingError(name, 'is neither a video nor a bag', remedy)
