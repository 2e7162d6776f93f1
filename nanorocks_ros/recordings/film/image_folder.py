"""Folders of images as films: order, time stamps from names or EXIF, and bit depth.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

import itertools
import re
import statistics
from typing import TYPE_CHECKING

import cv2
import numpy as np
from PIL import Image

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.film_source import (
    EncodedImage,
    FilmFrame,
    FilmInfo,
    image_format,
    rate_remedy,
)
from nanorocks_ros.recordings.film.image_file import FULL_BITS, bits_used, read_image
from nanorocks_ros.recordings.film.natural_sort import natural_key, varying_numbers
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg, jpeg_head, with_huffman_tables
from nanorocks_ros.recordings.messages.iso8601 import parse_iso8601
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from fractions import Fraction
    from pathlib import Path

    from numpy.typing import NDArray

IMAGE_SUFFIXES = frozenset(
    ['.jpg', '.jpeg', '.png', '.bmp', '.tif', '.tiff', '.webp', '.pgm', '.ppm', '.jp2']
)
"""File extensions of images."""

# EXIF tags: orientation, EXIF directory, time, fraction of the second, time zone.
_ORIENTATION, _EXIF, _TAKEN, _TAKEN_FRACTION, _ZONE = 0x0112, 0x8769, 0x9003, 0x9291, 0x9011
# Times since 1970 in file names: in ms, us or ns, by the number of digits, with the unit in ns;
# or in seconds with a fraction.
_UNIT_NS = {13: 10**6, 16: 10**3, 19: 1}
_SECONDS = re.compile(r'(?<!\d)(1\d{9})[._](\d{3,9})(?!\d)')
_INTEGER = re.compile(r'(?<!\d)(1\d{12}|1\d{15}|1\d{18})(?!\d)')
_DATE = re.compile(
    r'(?<!\d)((?:19|20)\d\d)-?(\d\d)-?(\d\d)'
    r'[T_ -](\d\d)[:_-]?(\d\d)[:_-]?(\d\d)[._-](\d{3,9})(?!\d)'
)
# Exceptions of Pillow; OpenCV may still decode such an image.
_UNREADABLE = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


def images_in(folder: Path) -> list[Path]:
    """The images in a folder, sorted naturally."""
    paths = (
        path
        for path in folder.iterdir()
        if path.suffix.lower() in IMAGE_SUFFIXES and not _is_hidden(path)
    )
    files = (path for path in paths if path.is_file())
    return sorted(files, key=lambda file: natural_key(file.name))


def _is_hidden(path: Path) -> bool:
    return path.name.startswith('.')


class ImageFolder:
    """A folder of images, in the natural order of their names.

    JPEG and PNG files are not recompressed, unless their orientation has to be applied.

    Parameters
    ----------
    path : Path
    rate : Fraction or None, [1/s]
        Frame rate of the camera. Without it, the names or the EXIF data of all images must
        contain a time stamp.

    Attributes
    ----------
    info : FilmInfo
    damaged : int
        Number of unusable images so far.

    Raises
    ------
    ConfigurationError
        If there are neither a rate nor time stamps.
    RecordingError
        If there are no images, or none can be decoded.
    """

    # Gaps in the numbers of its files are told before it is read.
    losses: tuple[str, ...] = ()

    def __init__(self, path: Path, rate: Fraction | None = None) -> None:
        self.damaged = 0
        files = images_in(path)
        if not files:
            raise RecordingError(str(path), 'holds no image', 'pass a video or a folder of images')
        first = next((image for image in map(read_image, files) if image is not None), None)
        if first is None:
            raise RecordingError(
                str(path),
                'holds no image that can be decoded',
                'check that they were copied completely',
            )
        self._times, remarks = _times(path, files, rate)
        self._bits = bits_used(files)
        if self._bits < FULL_BITS:
            notice = f'its images use {self._bits} of their {FULL_BITS} bits; converted to 8 bits'
            remarks += (f'{path}: {notice}',)
        steps = np.diff(np.array(self._times, dtype=np.int64))
        self.info = FilmInfo(
            path=path,
            files=tuple(files),
            codec=files[0].suffix.lower().lstrip('.'),
            width=first.shape[1],
            height=first.shape[0],
            step_ns=int(np.median(steps)) if steps.size else 0,
            start_ns=None if rate else self._times[0],
            as_stored=self._bits == FULL_BITS and all(_is_stored(file) for file in files),
            expected=len(files),
            remarks=remarks,
        )

    def frames(self) -> Iterator[FilmFrame]:
        """Usable images in order.

        Yields
        ------
        FilmFrame
        """
        for number, (file, time_ns) in enumerate(zip(self.info.files, self._times, strict=True)):
            picture = _picture(file, (self.info.width, self.info.height), self._bits)
            if picture is None:
                self.damaged += 1
                continue
            yield FilmFrame(time_ns, picture, (number + 1) / len(self.info.files))


class _ImagePixels:
    """A decoded image."""

    def __init__(self, image: NDArray[np.uint8]) -> None:
        self._image = image

    def gray(self) -> NDArray[np.uint8]:
        if self._image.ndim == 2:
            return self._image
        return np.asarray(cv2.cvtColor(self._image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)

    def pixels(self) -> NDArray[np.uint8]:
        return self._image


def _is_stored(file: Path) -> bool:
    """Whether its extension and orientation permit to write it without recompression."""
    if file.suffix.lower() not in {'.jpg', '.jpeg', '.png'}:
        return False
    try:
        with Image.open(file) as image:
            return bool(image.getexif().get(_ORIENTATION, 1) == 1)
    except _UNREADABLE:
        return True


def _picture(file: Path, size: tuple[int, int], bits: int) -> EncodedImage | _ImagePixels | None:
    """The image in a file; None if it is damaged or has another size (width, height)."""
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
            return EncodedImage(image_format('jpeg', head.channels), content)
        image = read_image(file, bits)
        is_png = bits == FULL_BITS and content.startswith(b'\x89PNG')
        if image is not None and is_png and _size(image) == size:
            return EncodedImage(image_format('png', image.ndim), content)
    image = read_image(file, bits) if image is None else image
    return _ImagePixels(image) if image is not None and _size(image) == size else None


def _size(image: NDArray[np.uint8]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _times(
    path: Path, files: Sequence[Path], rate: Fraction | None
) -> tuple[list[int], tuple[str, ...]]:
    """Time of each image, [ns], and notices for the user."""
    if rate is not None:
        numbers, notice = _frame_numbers(files)
        remarks = (f'{path}: {notice}',) if notice else ()
        return [round(number * NS / rate) for number in numbers], remarks
    for source, times in (
        ('their names', [_time_in_name(file.stem) for file in files]),
        ('their EXIF data', [_time_in_exif(file) for file in files]),
    ):
        known = [time for time in times if time is not None]
        rising = all(before < after for before, after in itertools.pairwise(known))
        if len(known) == len(files) and rising and len(files) > 1:
            return known, (f'{path}: the times of the images are taken from {source}',)
    raise ConfigurationError(
        str(path),
        'its images have no time stamps: neither all names nor all EXIF data contain one',
        rate_remedy(path),
    )


def _frame_numbers(files: Sequence[Path]) -> tuple[Sequence[int], str]:
    """Frame number of each image from 0, counting missing images, and a notice for the user."""
    consecutive = range(len(files))
    numbers = varying_numbers([file.stem for file in files])
    if numbers is None:
        return consecutive, ''
    steps = [after - before for before, after in itertools.pairwise(numbers)]
    usual = statistics.median_low(steps)
    if usual < 1 or 2 * steps.count(usual) < len(steps) or any(step % usual for step in steps):
        return consecutive, 'the numbers of its images do not rise evenly; they are ignored'
    frame_numbers = [(number - numbers[0]) // usual for number in numbers]
    missing = frame_numbers[-1] - consecutive[-1]
    notice = f'{missing} images are missing according to their numbers; their time is kept'
    return frame_numbers, notice if missing else ''


def _time_in_name(stem: str) -> int | None:
    """Time in the name of an image, since 1970, [ns]; None if there is none."""
    if match := _DATE.search(stem):
        return _timestamp_ns(match.groups()[:6], match.group(7))
    if match := _SECONDS.search(stem):
        return int(match.group(1)) * NS + int(f'{match.group(2):0<9}')
    if match := _INTEGER.search(stem):
        return int(match.group(1)) * _UNIT_NS[len(match.group(1))]
    return None


def _time_in_exif(file: Path) -> int | None:
    """Time in the EXIF data, since 1970, [ns]; None without a fraction: seconds are too coarse."""
    try:
        with Image.open(file) as image:
            tags = image.getexif().get_ifd(_EXIF)
    except _UNREADABLE:
        return None
    fraction = str(tags.get(_TAKEN_FRACTION, '')).strip()
    date = re.findall(r'\d+', str(tags.get(_TAKEN, '')))
    if not fraction.isdecimal() or len(date) != 6:
        return None
    return _timestamp_ns(date, fraction, str(tags.get(_ZONE) or ''))


def _timestamp_ns(date: Sequence[str], fraction: str, zone: str = '') -> int | None:
    year, month, day, hour, minute, second = date
    return parse_iso8601(f'{year}-{month}-{day}T{hour}:{minute}:{second}.{fraction}{zone}')
