"""Films that are to be imported: how, and whether they go together."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.film_source import NS
from nanorocks_ros.recordings.film.image_folder import ImageFolder, images_in
from nanorocks_ros.recordings.film.video import Video
from nanorocks_ros.recordings.messages.iso8601 import instant_text
from nanorocks_ros.studies.film_import.find_films import look_into
from nanorocks_ros.studies.synthetic.film_bag import check_quality

if TYPE_CHECKING:
    from collections.abc import Sequence
    from fractions import Fraction
    from pathlib import Path

    from nanorocks_ros.experiment.calibration import Calibration
    from nanorocks_ros.recordings.film.film_source import Film

_LAST_NS = 2**31 * 10**9
# Clocks of containers count whole seconds.
_UNSURE_NS = 3 * NS // 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportSettings:
    """How films are imported.

    Parameters
    ----------
    quality : int
        Of the JPEGs, 1 to 100, where pictures have to be compressed.
    start_ns : int or None, [ns]
        When the first picture was taken; None: as the film says.
    rate : Fraction or None, [1/s]
        Of the camera; None: as the film says.
    calibration : Calibration or None
        Of the camera.
    calibration_name : str
        Of the file it came from.
    threads : int
        That decode and compress; 0: as many as there are cores.
    """

    quality: int = 95
    start_ns: int | None = None
    rate: Fraction | None = None
    calibration: Calibration | None = None
    calibration_name: str = ''
    threads: int = 0

    def __post_init__(self) -> None:
        check_quality(self.quality)
        if self.rate is not None and self.rate <= 0:
            raise ConfigurationError('--rate', f'{self.rate}', 'give pictures per second, above 0')
        if self.start_ns is not None and not 0 <= self.start_ns < _LAST_NS:
            raise ConfigurationError(
                '--start',
                'lies before 1970 or after 2038, when stamps of messages end',
                'give another instant',
            )

    def given(self) -> dict[str, str]:
        """Those that change times and lens, by their flags, as a bag keeps them; or empty."""
        return {
            'rate': str(self.rate) if self.rate else '',
            'calibration': self.calibration_name,
            'start': '' if self.start_ns is None else instant_text(self.start_ns),
        }


def open_film(path: Path, settings: ImportSettings) -> Film:
    """Open a video or a folder of images.

    Raises
    ------
    ConfigurationError
        When nothing says when pictures were taken, or the library for videos is missing.
    RecordingError
        When it is neither.
    """
    try:
        if not path.exists():
            raise RecordingError(str(path), 'does not exist', 'pass a video or a folder of images')
        if not path.is_dir():
            return Video(path, settings.rate, settings.threads)
        if images_in(path):
            return ImageFolder(path, settings.rate)
        held = look_into(path).films
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be read ({error.strerror})', 'check its permissions'
        ) from error
    if held:
        raise RecordingError(
            str(path),
            f'is a folder of {len(held)} videos',
            'name the parts of one recording, or add --each to make a bag of each',
        )
    raise RecordingError(str(path), 'holds no video and no image', 'pass another folder')


def check_sizes(films: Sequence[Film], settings: ImportSettings) -> None:
    """Refuse films that do not go together.

    Raises
    ------
    ConfigurationError
        When the calibration is for another size.
    RecordingError
        When the parts of a film differ in size.
    """
    first = films[0].info
    for film in films[1:]:
        if (film.info.width, film.info.height) != (first.width, first.height):
            raise RecordingError(
                str(film.info.path),
                f'has pictures of {film.info.width}x{film.info.height} px, '
                f'{first.path} of {first.width}x{first.height} px',
                'import them into bags of their own',
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
    """Refuse parts of a film of which one was taken before the one that it is to follow.

    Times of creation are those of the beginning or of the end, as the camera likes it; both rise.

    Raises
    ------
    RecordingError
    """
    if settings.start_ns is not None:
        return
    known = [
        (film.info.path, film.info.start_ns) for film in films if film.info.start_ns is not None
    ]
    for (before, before_ns), (path, start_ns) in itertools.pairwise(known):
        if start_ns < before_ns - _UNSURE_NS:
            raise RecordingError(
                str(path),
                f'was taken at {instant_text(start_ns)}, before {before} at '
                f'{instant_text(before_ns)}, which it is to follow',
                'pass the parts in order of time, or --start, by which each follows the other',
            )
