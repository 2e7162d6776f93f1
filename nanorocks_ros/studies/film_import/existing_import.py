"""Check that an existing bag is the one that an import would make.

Tested by ``test/studies/film_import/test_import_each.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.experiment.recorded_experiment import EXPERIMENT_SETTINGS, experiment_key
from nanorocks_ros.recordings.bag.provenance import checksum
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.film.image_folder import images_in
from nanorocks_ros.recordings.messages.camera_info import info_from_message, info_message
from nanorocks_ros.studies.film_import.import_film import FRAME_ID
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from nanorocks_ros.experiment.calibration import CameraInfo
    from nanorocks_ros.recordings.bag.reader import BagReader
    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings

_REMEDY, _NOT_GIVEN = 'delete it, or pass another folder', 'not given'


def check_same_source(bag: Path, film: Path) -> None:
    """Check that a bag was made from this film.

    Parameters
    ----------
    bag : Path
    film : Path
        Its checksum is computed if name and size agree.

    Raises
    ------
    RecordingError
        If the bag is incomplete or was made from another film.
    """
    metadata = open_bag(bag).metadata
    if metadata.get('import') != 'complete' or metadata.get('source') != film.name:
        problem = f'exists already, but is not a complete import of {film.name}'
        raise RecordingError(str(bag), problem, _REMEDY)
    files = images_in(film) if film.is_dir() else [film]
    try:
        size = sum(file.stat().st_size for file in files)
    except OSError as error:
        raise RecordingError(
            str(film), f'cannot be read ({error.strerror})', 'pass another film'
        ) from error
    if metadata.get('source_bytes') != str(size):
        sizes = f'{metadata.get("source_bytes")} bytes, not {size}'
        raise RecordingError(str(bag), f'was made from another {film.name} ({sizes})', _REMEDY)
    # Cameras without compression make films of equal size and may reuse names every day.
    if metadata.get('source_sha256') != checksum(files):
        problem = f'was made from another {film.name} (same size, different content)'
        raise RecordingError(str(bag), problem, _REMEDY)


def check_same_settings(bag: Path, settings: ImportSettings) -> None:
    """Check that a bag was imported with these settings.

    Raises
    ------
    RecordingError
        If a setting differs; the message names each with both values.
    """
    reader = open_bag(bag)
    metadata, given = reader.metadata, settings.as_metadata()
    differences = []
    for name in ('rate', 'start'):
        before = metadata.get(f'import.{name}') or _NOT_GIVEN
        now = given[name] or _NOT_GIVEN
        if before != now:
            differences.append(f'--{name} was {before}, is {now}')
    if _lens_in(reader) != _lens_of(settings):
        names = metadata.get('import.calibration'), given['calibration']
        before, now = (name or _NOT_GIVEN for name in names)
        now = now if now != before else 'a file of the same name with different content'
        differences.append(f'--calibration was {before}, is {now}')
    pictures = metadata.get('pictures', '')
    # The quality does not matter for JPEGs that were not recompressed.
    if pictures.startswith('JPEG of') and pictures != settings.compression():
        differences.append(f'--quality was {pictures.split()[-1]}, is {settings.quality}')
    differences += _experiment_differences(metadata, settings)
    if differences:
        problem = f'was imported with other settings ({" and ".join(differences)})'
        raise RecordingError(str(bag), problem, _REMEDY)


def _experiment_differences(metadata: Mapping[str, str], settings: ImportSettings) -> list[str]:
    """What the bag says of its trays otherwise than the settings."""
    differences = []
    for name in EXPERIMENT_SETTINGS:
        key = experiment_key(name)
        before, now = metadata.get(key, ''), settings.experiment.get(key, '')
        # The lens of a calibration is compared by its camera_info.
        if before == now or name == 'preprocess.calibration':
            continue
        flag = key.rpartition('.')[2].replace('_', '-')
        texts = ['another' if '\n' in text else text or _NOT_GIVEN for text in (before, now)]
        differences.append(f'--{flag} was {texts[0]}, is {texts[1]}')
    return differences


def _lens_in(reader: BagReader) -> CameraInfo | None:
    """Lens calibration in a bag."""
    name = topics.CAMERA_INFO.absolute()
    first = next(iter(reader.messages([name])), None) if name in reader.topics else None
    return None if first is None else info_from_message(reader.deserialize(first))


def _lens_of(settings: ImportSettings) -> CameraInfo | None:
    """Lens calibration of the settings, rounded as in a bag."""
    if settings.calibration is None:
        return None
    return info_from_message(info_message(settings.calibration.info, 0, FRAME_ID))
