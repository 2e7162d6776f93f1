"""A folder of images as a film."""

from __future__ import annotations

import itertools
import re
import statistics
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.film_source import NS, FilmInfo, Shot, StoredPicture, form_of
from nanorocks_ros.recordings.film.image_file import FULL, bits_used, opened
from nanorocks_ros.recordings.film.natural_sort import natural, numbers_of
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg, jpeg_head, with_huffman_tables
from nanorocks_ros.recordings.messages.iso8601 import instant

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction
    from pathlib import Path

    from numpy.typing import NDArray

IMAGES = frozenset(
    ['.jpg', '.jpeg', '.png', '.bmp', '.tif', '.tiff', '.webp', '.pgm', '.ppm', '.jp2']
)
"""Endings of the files that are taken for images."""

_ORIENTATION, _EXIF, _TAKEN, _TAKEN_FRACTION, _ZONE = 0x0112, 0x8769, 0x9003, 0x9291, 0x9011
# Digits of a time since 1970 in seconds with a fraction, and without one in ms, µs, ns.
_SINCE_1970 = {13: 10**6, 16: 10**3, 19: 1}
_SECONDS = re.compile(r'(?<!\d)(1\d{9})[._](\d{3,9})(?!\d)')
_LONG = re.compile(r'(?<!\d)(1\d{12}|1\d{15}|1\d{18})(?!\d)')
_DATE = re.compile(
    r'(?<!\d)((?:19|20)\d\d)-?(\d\d)-?(\d\d)'
    r'[T_ -](\d\d)[:_-]?(\d\d)[:_-]?(\d\d)[._-](\d{3,9})(?!\d)'
)
# Of Pillow; an image that it refuses may still be one for OpenCV.
_UNREADABLE = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


def images_in(folder: Path) -> list[Path]:
    """The images in a folder, sorted naturally."""
    paths = (
        path for path in folder.iterdir() if path.suffix.lower() in IMAGES and not _hidden(path)
    )
    return sorted((path for path in paths if path.is_file()), key=lambda one: natural(one.name))


def _hidden(path: Path) -> bool:
    return path.name.startswith('.')


class ImageFolder:
    """A folder of images, in the natural order of their names.

    JPEG and PNG files go into the bag as they are, unless their orientation has to be applied.

    Parameters
    ----------
    path : Path
    rate : Fraction or None, [1/s]
        Of the camera. Without it, the names or the camera's own notes in the images have to
        tell when each was taken.

    Attributes
    ----------
    info : FilmInfo
    broken : int
        Images that could not be used, so far.

    Raises
    ------
    ConfigurationError
        When nothing says when the images were taken.
    RecordingError
        When there are none, or they cannot be read.
    """

    def __init__(self, path: Path, rate: Fraction | None = None) -> None:
        self.broken = 0
        files = images_in(path)
        if not files:
            raise RecordingError(str(path), 'holds no image', 'pass a video or a folder of images')
        first = next((one for one in map(opened, files) if one is not None), None)
        if first is None:
            raise RecordingError(
                str(path),
                'holds no image that can be decoded',
                'check that they were copied whole',
            )
        self._times, remarks = _times(path, files, rate)
        self._bits = bits_used(files)
        if self._bits < FULL:
            said = f'its images use {self._bits} of their {FULL} bits; they are made 8 of those'
            remarks += (f'{path}: {said}',)
        steps = np.diff(np.array(self._times, dtype=np.int64))
        self.info = FilmInfo(
            path=path,
            files=tuple(files),
            codec=files[0].suffix.lower().lstrip('.'),
            width=first.shape[1],
            height=first.shape[0],
            step_ns=int(np.median(steps)) if steps.size else 0,
            start_ns=None if rate else self._times[0],
            as_stored=self._bits == FULL and all(_is_stored(file) for file in files),
            expected=len(files),
            remarks=remarks,
        )

    def shots(self) -> Iterator[Shot]:
        """The images that can be used, in order.

        Yields
        ------
        Shot
        """
        for number, (file, time_ns) in enumerate(zip(self.info.files, self._times, strict=True)):
            picture = _picture(file, (self.info.width, self.info.height), self._bits)
            if picture is None:
                self.broken += 1
                continue
            yield Shot(time_ns, picture, (number + 1) / len(self.info.files))


class _Drawn:
    """An image that was decoded."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        self._image = image

    def gray(self) -> NDArray[np.uint8]:
        if self._image.ndim == 2:
            return self._image
        return np.asarray(cv2.cvtColor(self._image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)

    def pixels(self) -> NDArray[np.uint8]:
        return self._image


def _is_stored(file: Path) -> bool:
    """Whether it goes into a bag as it is, as far as its name and orientation say."""
    if file.suffix.lower() not in {'.jpg', '.jpeg', '.png'}:
        return False
    try:
        with Image.open(file) as image:
            return bool(image.getexif().get(_ORIENTATION, 1) == 1)
    except _UNREADABLE:
        return True


def _picture(file: Path, size: tuple[int, int], bits: int) -> StoredPicture | _Drawn | None:
    """The picture in a file; None where it is damaged, or of another size: (width, height)."""
    image = None
    if _is_stored(file):
        try:
            content = file.read_bytes()
        except OSError:
            return None
        head = jpeg_head(content)
        if head is not None:
            if not is_whole_jpeg(content) or (head.width, head.height) != size:
                return None
            content = with_huffman_tables(content, head)
            return StoredPicture(form_of('jpeg', head.channels), content)
        image = opened(file, bits)
        as_it_is = bits == FULL and content.startswith(b'\x89PNG')
        if image is not None and as_it_is and _size(image) == size:
            return StoredPicture(form_of('png', image.ndim), content)
    image = opened(file, bits) if image is None else image
    return _Drawn(image) if image is not None and _size(image) == size else None


def _size(image: NDArray[np.uint8]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _times(
    path: Path, files: Sequence[Path], rate: Fraction | None
) -> tuple[list[int], tuple[str, ...]]:
    """When each image was taken, and what is to be said of it."""
    if rate is not None:
        places, said = _places(files)
        remarks = (f'{path}: {said}',) if said else ()
        return [round(place * NS / rate) for place in places], remarks
    for how, times in (
        ('their names', [_time_in_name(file.stem) for file in files]),
        ('their EXIF notes', [_time_in_exif(file) for file in files]),
    ):
        known = [time for time in times if time is not None]
        rising = all(one < other for one, other in itertools.pairwise(known))
        if len(known) == len(files) and rising and len(files) > 1:
            return known, (f'{path}: the images were taken when {how} say',)
    raise ConfigurationError(
        str(path),
        'nothing says when its images were taken: neither their names nor EXIF do, all of them',
        'pass --rate, in images per second',
    )


def _places(files: Sequence[Path]) -> tuple[Sequence[int], str]:
    """Where each image stands in a row that goes on where numbers are missing, and what to say."""
    row = range(len(files))
    numbers = numbers_of([file.stem for file in files])
    if numbers is None:
        return row, ''
    steps = [other - one for one, other in itertools.pairwise(numbers)]
    usual = statistics.median_low(steps)
    if usual < 1 or 2 * steps.count(usual) < len(steps) or any(step % usual for step in steps):
        return row, 'the numbers of its images do not rise evenly; they are stamped one by one'
    places = [(number - numbers[0]) // usual for number in numbers]
    lost = places[-1] - row[-1]
    said = f'{lost} images are missing by their numbers; the time that they took is kept'
    return places, said if lost else ''


def _time_in_name(stem: str) -> int | None:
    if found := _DATE.search(stem):
        return _instant(found.groups()[:6], found.group(7))
    if found := _SECONDS.search(stem):
        return int(found.group(1)) * NS + int(f'{found.group(2):0<9}')
    if found := _LONG.search(stem):
        return int(found.group(1)) * _SINCE_1970[len(found.group(1))]
    return None


def _time_in_exif(file: Path) -> int | None:
    """When the camera says that it took an image; whole seconds are too coarse for a film."""
    try:
        with Image.open(file) as image:
            notes = image.getexif().get_ifd(_EXIF)
    except _UNREADABLE:
        return None
    fraction = str(notes.get(_TAKEN_FRACTION, '')).strip()
    date = re.findall(r'\d+', str(notes.get(_TAKEN, '')))
    if not fraction.isdecimal() or len(date) != 6:
        return None
    return _instant(date, fraction, str(notes.get(_ZONE) or ''))


def _instant(date: Sequence[str], fraction: str, zone: str = '') -> int | None:
    year, month, day, hour, minute, second = date
    return instant(f'{year}-{month}-{day}T{hour}:{minute}:{second}.{fraction}{zone}')
