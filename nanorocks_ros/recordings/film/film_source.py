"""What every film offers, be it a video or a folder of images: its pictures and their times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, Protocol

from nanorocks_ros.recordings.messages.image_messages import decoded_gray, encode_jpeg

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

NS = 1_000_000_000
_GRAY, _COLOUR = 'mono8', 'bgr8'


def form_of(kind: str, channels: int) -> str:
    """What stands in the ``format`` of a compressed image message.

    Parameters
    ----------
    kind : str
        ``jpeg`` or ``png``.
    channels : int
    """
    encoding = _GRAY if channels == 1 else _COLOUR
    return f'{encoding}; {kind} compressed {encoding}'


@dataclass(frozen=True, slots=True)
class StoredPicture:
    """A picture whose bytes go into the bag as they are.

    Parameters
    ----------
    form : str
        As `form_of` makes it.
    content : bytes
    """

    form: str
    content: bytes

    def gray(self) -> NDArray[np.uint8]:
        """Its brightness, to compare it with others; empty when it cannot be decoded."""
        return decoded_gray(self.content)


class DrawnPicture(Protocol):
    """A picture that has to be compressed."""

    def gray(self) -> NDArray[np.uint8]:
        """Its brightness, to compare it with others, (height, width)."""

    def pixels(self) -> NDArray[np.uint8]:
        """Its pixels, upright: bgr, or gray with two axes."""


def stored(picture: StoredPicture | DrawnPicture, quality: int) -> StoredPicture:
    """The picture as a bag holds it: as JPEG, unless its bytes go in as they are.

    Parameters
    ----------
    picture : StoredPicture or DrawnPicture
    quality : int
        Of the JPEG, 1 to 100.

    Raises
    ------
    FrameError
        When it cannot be compressed.
    """
    if isinstance(picture, StoredPicture):
        return picture
    pixels = picture.pixels()
    return StoredPicture(form_of('jpeg', pixels.ndim), encode_jpeg(pixels, quality))


class Shot(NamedTuple):
    """A picture, when it was taken, and where it stands in the film.

    Parameters
    ----------
    time_ns : int or None, [ns]
        By the clock of the film; None where the film does not say.
    picture : StoredPicture or DrawnPicture
    done : float
        Share of the film read until here.
    """

    time_ns: int | None
    picture: StoredPicture | DrawnPicture
    done: float


@dataclass(slots=True, kw_only=True)
class FilmInfo:
    """What a film says of itself.

    Parameters
    ----------
    path : Path
    files : tuple of Path
        What it consists of.
    codec : str
        ``h264``, ``mjpeg``, ``png``.
    width, height : int, [px]
        Of the pictures in the bag: upright.
    step_ns : int, [ns]
        Usual time between two pictures; 0 when unknown.
    start_ns : int or None, [ns]
        When it was taken, since 1970.
    as_stored : bool
        Its pictures go into the bag as they are stored.
    expected : int
        Pictures that it says it holds; 0 when it doesn't.
    remarks : tuple of str
        What the user should know of it.
    tags : dict of str to str
        What the camera wrote into it.
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
    """A film, opened.

    Attributes
    ----------
    info : FilmInfo
    broken : int
        Pictures that could not be used, so far.
    """

    info: FilmInfo
    broken: int

    def shots(self) -> Iterator[Shot]:
        """The pictures that can be used, in the order of the film."""
