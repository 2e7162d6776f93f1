"""The interface of films (videos and folders of images): frames, their times, and metadata.

Tested by ``test/recordings/film/test_duplicate_frames.py``.
"""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

from nanorocks_ros.recordings.messages.image_messages import decoded_gray, encode_jpeg

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

_GRAY, _COLOUR = 'mono8', 'bgr8'


def image_format(kind: str, channels: int) -> str:
    """The ``format`` field of a compressed image message.

    Parameters
    ----------
    kind : str
        ``jpeg`` or ``png``.
    channels : int
    """
    encoding = _GRAY if channels == 1 else _COLOUR
    return f'{encoding}; {kind} compressed {encoding}'


@dataclass(frozen=True, slots=True)
class EncodedImage:
    """An image file whose bytes are written to the bag without recompression.

    Parameters
    ----------
    format : str
        As returned by `image_format`.
    content : bytes
    """

    format: str
    content: bytes

    def gray(self) -> NDArray[np.uint8]:
        """Brightness, (height, width); empty if the image cannot be decoded."""
        return decoded_gray(self.content)


class DecodedImage(Protocol):
    """An image that has to be compressed."""

    def gray(self) -> NDArray[np.uint8]:
        """Brightness, (height, width)."""

    def pixels(self) -> NDArray[np.uint8]:
        """Pixels, upright: (height, width, 3), bgr, or (height, width), gray."""


def encoded(picture: EncodedImage | DecodedImage, quality: int) -> EncodedImage:
    """Compress an image to JPEG; an `EncodedImage` is returned unchanged.

    Parameters
    ----------
    picture : EncodedImage or DecodedImage
    quality : int
        Of the JPEG, 1 to 100.

    Raises
    ------
    FrameError
        If the image cannot be compressed.
    """
    if isinstance(picture, EncodedImage):
        return picture
    pixels = picture.pixels()
    return EncodedImage(image_format('jpeg', pixels.ndim), encode_jpeg(pixels, quality))


class FilmFrame(NamedTuple):
    """A frame of a film.

    Parameters
    ----------
    time_ns : int or None, [ns]
        Time by the clock of the film; None if the film does not state it.
    picture : EncodedImage or DecodedImage
    done : float
        Fraction of the film that has been read, 0 to 1.
    """

    time_ns: int | None
    picture: EncodedImage | DecodedImage
    done: float


@dataclass(slots=True, kw_only=True)
class FilmInfo:
    """Metadata of a film.

    Parameters
    ----------
    path : Path
    files : tuple of Path
        Files of the film.
    codec : str
        ``h264``, ``mjpeg``, ``png``.
    width, height : int, [px]
        Size of the frames in the bag, upright.
    step_ns : int, [ns]
        Usual time between two frames; 0 if unknown.
    start_ns : int or None, [ns]
        Time of recording, since 1970; None if unknown.
    as_stored : bool
        Whether its frames are written to the bag without recompression.
    expected : int
        Number of frames according to the file; 0 if it is not stated.
    remarks : tuple of str
        Notices for the user.
    tags : dict of str to str
        Metadata written by the camera.
    """

    path: Path
    files: tuple[Path, ...]
    codec: str
    width: int
    height: int
    step_ns: int = 0
    start_ns: int | None = None
    as_stored: bool = False
    expected: int = 0
    remarks: tuple[str, ...] = ()
    tags: dict[str, str] = field(default_factory=dict)


class Film(Protocol):
    """An open film.

    Attributes
    ----------
    info : FilmInfo
    damaged : int
        Number of unusable frames so far.
    losses : tuple of str
        What is missing of it, in sentences; final once its frames have been read.
    """

    info: FilmInfo
    damaged: int

    @property
    def losses(self) -> tuple[str, ...]:
        """What is missing of the film, in sentences."""

    def frames(self) -> Iterator[FilmFrame]:
        """Usable frames in the order of the film."""


def rate_remedy(path: Path) -> str:
    """What to do with a film that tells no times, whichever command it was given to."""
    name = shlex.quote(str(path))
    bag = shlex.quote(str(path.with_name(f'{path.stem}_bag')))
    return f'give the frames per second, such as 30: nanorocks import {name} --rate 30 -o {bag}'
