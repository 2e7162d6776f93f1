"""Whether a bag that is there already is the one that an import would make."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.provenance import checksum
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.film.image_folder import images_in
from nanorocks_ros.recordings.messages.camera_info import info_from_message, info_message
from nanorocks_ros.studies.film_import.import_film import FRAME_ID, picture_words
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.experiment.calibration import CameraInfo
    from nanorocks_ros.recordings.bag.reader import BagReader
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings

_NEW, _NOT = 'delete it, or pass another folder', 'not given'


def check_same_source(bag: Path, film: Path) -> None:
    """Refuse to take the bag of another film for that of this one.

    Parameters
    ----------
    bag : Path
    film : Path
        Is read as a whole, where name and size are those of the bag's.

    Raises
    ------
    RecordingError
    """
    kept = open_bag(bag).metadata
    if kept.get('import') != 'complete' or kept.get('source') != film.name:
        what = f'is there already, but not as the bag of {film.name}'
        raise RecordingError(str(bag), what, _NEW)
    files = images_in(film) if film.is_dir() else [film]
    try:
        size = sum(file.stat().st_size for file in files)
    except OSError as error:
        raise RecordingError(
            str(film), f'cannot be read ({error.strerror})', 'pass another film'
        ) from error
    if kept.get('source_bytes') != str(size):
        sizes = f'{kept.get("source_bytes")} bytes, not {size}'
        raise RecordingError(str(bag), f'was made of another {film.name} ({sizes})', _NEW)
    # Cameras that do not compress make films of one size, and number them anew each day.
    if kept.get('source_sha256') != checksum(files):
        what = f'was made of another {film.name} (of the same size, with other contents)'
        raise RecordingError(str(bag), what, _NEW)


def check_same_settings(bag: Path, settings: ImportSettings) -> None:
    """Refuse to take a bag for that of other settings.

    Raises
    ------
    RecordingError
        Names each that differs, as it was and as it is to be.
    """
    reader = open_bag(bag)
    kept, given = reader.metadata, settings.given()
    differing = []
    for name in ('rate', 'start'):
        was, now = kept.get(f'import.{name}') or _NOT, given[name] or _NOT
        if was != now:
            differing.append(f'--{name} was {was}, is {now}')
    if _lens_in(reader) != _lens_of(settings):
        names = kept.get('import.calibration'), given['calibration']
        was, now = (name or _NOT for name in names)
        now = now if now != was else 'one of that name with other contents'
        differing.append(f'--calibration was {was}, is {now}')
    pictures = kept.get('pictures', '')
    # Of JPEGs that went in as they are, the quality is that of the camera.
    if pictures.startswith('JPEG of') and pictures != picture_words(settings):
        differing.append(f'--quality was {pictures.split()[-1]}, is {settings.quality}')
    if differing:
        what = f'was imported with other settings ({" and ".join(differing)})'
        raise RecordingError(str(bag), what, _NEW)


def _lens_in(reader: BagReader) -> CameraInfo | None:
    """The lens that a bag describes."""
    name = topics.CAMERA_INFO.absolute()
    first = next(iter(reader.messages([name])), None) if name in reader.topics else None
    return None if first is None else info_from_message(reader.deserialize(first))


def _lens_of(settings: ImportSettings) -> CameraInfo | None:
    """The lens that the calibration describes, as a bag would say it."""
    if settings.calibration is None:
        return None
    return info_from_message(info_message(settings.calibration.info, 0, FRAME_ID))
