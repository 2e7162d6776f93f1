"""The films that folders hold: videos, and folders of images."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.image_folder import IMAGES, images_in
from nanorocks_ros.recordings.names import natural
from nanorocks_ros.recordings.streams import VIDEOS, looks_like_film

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


@dataclass(slots=True)
class FoundFilms:
    """What paths stand for.

    Parameters
    ----------
    films : list of Path
        Videos and folders of images.
    left_out : list of Path
        Files in folders that look like films or pictures, and are not among them.
    """

    films: list[Path] = field(default_factory=list)
    left_out: list[Path] = field(default_factory=list)


def films_of(paths: Sequence[Path]) -> FoundFilms:
    """The films that paths stand for: a folder of videos for those in it, sorted naturally.

    Images beside videos make no film.

    Raises
    ------
    RecordingError
        When a folder holds none, or cannot be read.
    """
    found = FoundFilms()
    for path in paths:
        try:
            if not path.is_dir():
                found.films.append(path)
                continue
            held = look_into(path)
            if images_in(path) and not any(one.is_file() for one in held.films):
                found.films.append(path)
                continue
        except OSError as error:
            raise RecordingError(
                str(path), f'cannot be read ({error.strerror})', 'check its permissions'
            ) from error
        if not held.films:
            raise RecordingError(str(path), 'holds no video and no image', 'pass another folder')
        found.films += held.films
        found.left_out += held.left_out
    return found


def look_into(folder: Path) -> FoundFilms:
    """The videos in a folder, and the folders of images in it, sorted naturally.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    found = FoundFilms()
    for one in sorted(folder.iterdir(), key=lambda one: natural(one.name)):
        if one.name.startswith('.'):
            continue
        if bool(images_in(one)) if one.is_dir() else one.suffix.lower() in VIDEOS:
            found.films.append(one)
        elif one.suffix.lower() in IMAGES or looks_like_film(one):
            found.left_out.append(one)
    return found
