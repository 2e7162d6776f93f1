"""The films that folders hold: videos, and folders of images."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.film.image_folder import IMAGES, images_in
from nanorocks_ros.recordings.film.natural_sort import OF_THE_DISK, natural
from nanorocks_ros.recordings.film.video_streams import VIDEOS, looks_like_film

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.errors import NanorocksError


@dataclass(slots=True)
class FoundFilms:
    """What paths stand for.

    Parameters
    ----------
    films : list of Path
        Videos and folders of images.
    left_out : list of Path
        Files in folders that look like films or pictures, and are not among them.
    failed : dict of Path to NanorocksError
        What is in folders and cannot be read.
    """

    films: list[Path] = field(default_factory=list)
    left_out: list[Path] = field(default_factory=list)
    failed: dict[Path, NanorocksError] = field(default_factory=dict)


def films_of(paths: Sequence[Path]) -> FoundFilms:
    """The films that paths stand for: a folder of videos for those in it, sorted naturally.

    Images beside videos make no film.

    Raises
    ------
    RecordingError
        When there are none.
    """
    found = FoundFilms()
    for path in paths:
        try:
            held = _stand_for(path)
        except OSError as error:
            found.failed[path] = _unreadable(path, error)
            continue
        if not held.films and not held.failed:
            found.failed[path] = RecordingError(
                str(path), 'holds no video and no image', 'pass another folder'
            )
        found.films += held.films
        found.left_out += held.left_out
        found.failed |= held.failed
    if not found.films:
        raise next(iter(found.failed.values()))
    return found


def _stand_for(path: Path) -> FoundFilms:
    if not path.is_dir():
        return FoundFilms([path])
    held = look_into(path)
    if images_in(path) and not any(film.is_file() for film in held.films):
        return FoundFilms([path])
    return held


def look_into(folder: Path) -> FoundFilms:
    """The videos in a folder, and the folders of images in it, sorted naturally.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    found = FoundFilms()
    for path in sorted(folder.iterdir(), key=lambda one: natural(one.name)):
        if path.name.startswith('.') or path.name in OF_THE_DISK:
            continue
        try:
            if bool(images_in(path)) if path.is_dir() else path.suffix.lower() in VIDEOS:
                found.films.append(path)
            elif path.suffix.lower() in IMAGES or looks_like_film(path):
                found.left_out.append(path)
        except OSError as error:
            found.failed[path] = _unreadable(path, error)
    return found


def _unreadable(path: Path, error: OSError) -> RecordingError:
    return RecordingError(str(path), f'cannot be read ({error.strerror})', 'check its permissions')
