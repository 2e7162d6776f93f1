"""Settings of an import, opening of films, and checks that the parts of a film fit together.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.image_folder import ImageFolder, images_in
from nanorocks_ros.recordings.film.video import Video
from nanorocks_ros.recordings.messages.iso8601 import format_iso8601
from nanorocks_ros.records import NS
from nanorocks_ros.studies.film_import.find_films import films_in_folder
from nanorocks_ros.studies.results.results_folders import refuse_results
from nanorocks_ros.studies.synthetic.film_bag import check_quality

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction
    from pathlib import Path

    from nanorocks_ros.experiment.calibration import Calibration
    from nanorocks_ros.recordings.film.film_source import Film

_LAST_NS = 2**31 * 10**9
# Uncertainty of the time of recording: containers count whole seconds.
_TIME_ERROR_NS = 3 * NS // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportSettings:
    """Settings of an import.

    Parameters
    ----------
    quality : int
        JPEG quality of frames that have to be compressed, 1 to 100.
    start_ns : int or None, [ns]
        Time of the first frame; None: as stated in the film.
    rate : Fraction or None, [1/s]
        Frame rate of the camera; None: as stated in the film.
    calibration : Calibration or None
        Calibration of the camera.
    calibration_name : str
        Name of the calibration file.
    experiment : dict of str to str
        What the bag is to say of its trays; see `experiment_metadata`.
    threads : int
        Number of threads for decoding and compression; 0: one per core.
    """

    quality: int = 95
    start_ns: int | None = None
    rate: Fraction | None = None
    calibration: Calibration | None = None
    calibration_name: str = ''
    experiment: dict[str, str] = field(default_factory=dict)
    threads: int = 0

    def __post_init__(self) -> None:
        check_quality(self.quality)
        if self.rate is not None and self.rate <= 0:
            raise ConfigurationError('--rate', f'{self.rate}', 'give frames per second, above 0')
        if self.start_ns is not None and not 0 <= self.start_ns < _LAST_NS:
            raise ConfigurationError(
                '--start',
                'is before 1970 or after 2038, where the time stamps of ROS end',
                'give another time',
            )

    def as_metadata(self) -> dict[str, str]:
        """Settings of times and lens by the names of their flags, as stored in the bag."""
        return {
            'rate': str(self.rate) if self.rate else '',
            'calibration': self.calibration_name,
            'start': '' if self.start_ns is None else format_iso8601(self.start_ns),
        }

    def compression(self) -> str:
        """Description of the compression, as stored in the bag."""
        return f'JPEG of quality {self.quality}'


def open_film(path: Path, settings: ImportSettings) -> Film:
    """Open a video or a folder of images.

    Raises
    ------
    ConfigurationError
        If the film has neither time stamps nor a rate, or PyAV is not installed.
    RecordingError
        If it is neither a video nor a folder of images.
    """
    try:
        if not path.exists():
            raise RecordingError(str(path), 'does not exist', 'pass a video or a folder of images')
        refuse_results(path)
        if not path.is_dir():
            return Video(path, settings.rate, settings.threads)
        if images_in(path):
            return ImageFolder(path, settings.rate)
        films = films_in_folder(path).films
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'check its permissions'
        ) from error
    if films:
        raise RecordingError(
            str(path),
            f'is a folder of {len(films)} videos',
            'name the parts of one recording, or add --each to make a bag of each video',
        )
    raise RecordingError(str(path), 'holds no video and no image', 'pass another folder')


def check_sizes(films: Sequence[Film], settings: ImportSettings) -> None:
    """Check that all parts of a film have the same frame size, which fits the calibration.

    Raises
    ------
    ConfigurationError
        If the calibration is for another size.
    RecordingError
        If the parts of a film differ in size.
    """
    first = films[0].info
    for film in films[1:]:
        if (film.info.width, film.info.height) != (first.width, first.height):
            raise RecordingError(
                str(film.info.path),
                f'has frames of {film.info.width}x{film.info.height} px, '
                f'{first.path} of {first.width}x{first.height} px',
                'import them into separate bags',
            )
    lens = settings.calibration.info if settings.calibration else None
    if lens and (lens.width, lens.height) != (first.width, first.height):
        raise ConfigurationError(
            settings.calibration_name,
            f'is for {lens.width}x{lens.height} px, '
            f'{first.path} has {first.width}x{first.height} px',
            'pass the calibration of this camera at this size',
        )


def check_order(films: Sequence[Film], settings: ImportSettings) -> None:
    """Check that the parts of a film are in order of time.

    Depending on the camera, the creation time is that of the first or of the last frame; both
    rise from part to part.

    Raises
    ------
    RecordingError
        If a part was recorded before the previous one.
    """
    if settings.start_ns is not None:
        return
    known = [
        (film.info.path, film.info.start_ns) for film in films if film.info.start_ns is not None
    ]
    for (before, before_ns), (path, start_ns) in itertools.pairwise(known):
        if start_ns < before_ns - _TIME_ERROR_NS:
            raise RecordingError(
                str(path),
                f'was recorded at {format_iso8601(start_ns)}, before the previous part {before} '
                f'at {format_iso8601(before_ns)}',
                'pass the parts in order of time, or pass --start to join them without gaps',
            )
