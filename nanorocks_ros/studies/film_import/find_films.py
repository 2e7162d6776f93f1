"""Find films by paths: videos, and folders of videos or images.

Tested by ``test/studies/film_import/test_import_each.py``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.film.image_folder import IMAGE_SUFFIXES, images_in
from nanorocks_ros.recordings.film.natural_sort import SYSTEM_FOLDERS, natural_key
from nanorocks_ros.recordings.film.video_streams import VIDEO_SUFFIXES, looks_like_film
from nanorocks_ros.studies.results.results_folders import holds_results

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.errors import NanorocksError


@dataclass(slots=True)
class FoundFilms:
    """Films found by `find_films`.

    Parameters
    ----------
    films : list of Path
        Videos and folders of images.
    left_out : list of Path
        Skipped files in folders that may be videos or images.
    failed : dict of Path to NanorocksError
        Paths that cannot be read or contain no film.
    """

    films: list[Path] = field(default_factory=list)
    left_out: list[Path] = field(default_factory=list)
    failed: dict[Path, NanorocksError] = field(default_factory=dict)


def find_films(paths: Sequence[Path]) -> FoundFilms:
    """Find films; the videos in a folder are sorted naturally.

    Images in the same folder as videos are not a film.

    Raises
    ------
    RecordingError
        If there are no films.
    """
    result = FoundFilms()
    for path in paths:
        try:
            films = _films_at(path)
        except OSError as error:
            result.failed[path] = _unreadable(path, error)
            continue
        if not films.films and not films.failed:
            result.failed[path] = RecordingError(
                str(path), 'holds no video and no image', 'pass another folder'
            )
        result.films += films.films
        result.left_out += films.left_out
        result.failed |= films.failed
    if not result.films:
        raise next(iter(result.failed.values()))
    return result


def _films_at(path: Path) -> FoundFilms:
    if not path.is_dir():
        return FoundFilms([path])
    inside = films_in_folder(path)
    if images_in(path) and not any(film.is_file() for film in inside.films):
        return FoundFilms([path])
    return inside


def films_in_folder(folder: Path) -> FoundFilms:
    """Videos and folders of images in a folder, sorted naturally.

    Raises
    ------
    OSError
        If the folder cannot be read.
    """
    result = FoundFilms()
    for path in sorted(folder.iterdir(), key=lambda entry: natural_key(entry.name)):
        if path.name.startswith('.') or path.name in SYSTEM_FOLDERS:
            continue
        try:
            if holds_results(path):
                continue
            if bool(images_in(path)) if path.is_dir() else path.suffix.lower() in VIDEO_SUFFIXES:
                result.films.append(path)
            elif path.suffix.lower() in IMAGE_SUFFIXES or looks_like_film(path):
                result.left_out.append(path)
        except OSError as error:
            result.failed[path] = _unreadable(path, error)
    return result


def _unreadable(path: Path, error: OSError) -> RecordingError:
    return RecordingError(str(path), f'cannot be read ({error.strerror})', 'check its permissions')
