"""Imports of films that are kept beside them, so that a film can be named wherever a bag can."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.outputs.unfinished_files import delete_unfinished_folders, unfinished_folder
from nanorocks_ros.recordings.bag.find_bags import is_recording
from nanorocks_ros.recordings.film.image_folder import images_in
from nanorocks_ros.recordings.film.video_streams import VIDEO_SUFFIXES, looks_like_film
from nanorocks_ros.studies.results.results_folders import holds_results

if TYPE_CHECKING:
    from collections.abc import Callable

CACHE = '.nanorocks'
"""Name of the folder of imports beside the films; commands on folders skip it."""


class CachedFilm(NamedTuple):
    """The import of a film.

    Parameters
    ----------
    bag : Path
    frames : int
    notices : tuple of str
        Of the import; empty when it was made before.
    reused : bool
        Whether the import was made before, and the film is unchanged.
    """

    bag: Path
    frames: int
    notices: tuple[str, ...]
    reused: bool


def is_film(path: Path) -> bool:
    """Whether a path is a video or a folder of images, and neither a recording nor results.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if path.is_dir():
        return not is_recording(path) and bool(images_in(path)) and not holds_results(path)
    if not path.is_file() or is_recording(path):
        return False
    return path.suffix.lower() in VIDEO_SUFFIXES or looks_like_film(path)


def cached_import(film: Path, progress: Callable[[float], None]) -> CachedFilm:
    """The bag of a film: imported, unless the import of the unchanged film is there.

    An import is given its name when it is complete; one that is interrupted leaves nothing.

    Parameters
    ----------
    film : Path
        Video or folder of images.
    progress : callable
        Called with the fraction that is done, 0 to 1.

    Raises
    ------
    RecordingError
        If the film cannot be read, or no cache folder can be written.
    """
    # Every command asks whether it is given a film; what writes bags takes time to import.
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
    from nanorocks_ros.studies.film_import.import_film import import_films

    state = _state(film)
    folder = cache_folder(film)
    bag, record = folder / film.resolve().name, folder / f'{film.resolve().name}.json'
    known = _read(record)
    frames = known.get('frames')
    if known.get('film') == state and isinstance(frames, int) and bag.is_dir():
        return CachedFilm(bag, frames, (), reused=True)
    # Of other films, too.
    delete_unfinished_folders(folder)
    with unfinished_folder(bag) as part:
        try:
            imported = import_films([film], part / bag.name, ImportSettings(), progress)
        except RecordingError as error:
            # Not the hidden folder that was written.
            where = error.where.replace(str(part), str(folder))
            raise RecordingError(where, error.what, error.do) from error
        with suppress(FileNotFoundError):
            record.unlink()
        shutil.rmtree(bag, ignore_errors=True)
        os.replace(part / bag.name, bag)
    content = {'film': state, 'frames': imported.frames}
    write_bytes(record, json.dumps(content).encode())
    return CachedFilm(bag, imported.frames, tuple(imported.notices), reused=False)


def _state(film: Path) -> str:
    """What changes with the film: its place, sizes and times of its files; and the version."""
    files = images_in(film) if film.is_dir() else [film]
    digest = hashlib.blake2b(f'{__version__} {film.resolve()}'.encode(), digest_size=16)
    for file in files:
        status = file.stat()
        digest.update(f'{file.name} {status.st_size} {status.st_mtime_ns}\n'.encode())
    return digest.hexdigest()


def _read(record: Path) -> dict[str, object]:
    """What is known of an import; empty when there is none."""
    try:
        return read_object(record)
    except (OSError, ValueError, RecordingError):
        return {}


def cache_folder(film: Path) -> Path:
    """Folder for the import: beside the film, or in the cache of the user."""
    beside = film.resolve().parent / CACHE
    home = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache')
    name = hashlib.blake2b(str(beside).encode(), digest_size=8).hexdigest()
    for folder in (beside, home / 'nanorocks' / name):
        with suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    raise RecordingError(
        str(film),
        f'cannot be imported: neither {beside} nor {home} can be written',
        f'import it yourself: nanorocks import {shlex.quote(str(film))} -o '
        f'{shlex.quote(film.resolve().stem)}',
    )
