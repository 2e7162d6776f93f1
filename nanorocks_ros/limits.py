"""Limits on what a file may claim: sizes, depths and counts, read from the environment.

Hostile and damaged files claim anything: a chunk of 3 kB that unpacks to 1 TB, YAML whose aliases
expand to a billion nodes, an image of 10^10 pixels. Each limit is far above real data (a bag of
178 hours, 4k frames) and is raised by an environment variable, which the error names.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass

from nanorocks_ros.errors import ConfigurationError, NanorocksError, RecordingError

_PREFIX = 'NANOROCKS_MAX_'
_LONGEST_SHOWN = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """Largest value of one quantity that a file claims.

    Parameters
    ----------
    name : str
        In lower case; the variable is ``NANOROCKS_MAX_`` and the name in upper case.
    default : int
    unit : str
        For example ``bytes``.
    quantity : str
        What is limited, for the documentation and for errors.
    """

    name: str
    default: int
    unit: str
    quantity: str

    @property
    def variable(self) -> str:
        """Environment variable that replaces the default."""
        return f'{_PREFIX}{self.name.upper()}'

    @property
    def value(self) -> int:
        """The limit that holds now.

        Raises
        ------
        ConfigurationError
            If the environment variable is no positive whole number.
        """
        text = os.environ.get(self.variable, '')
        if not text:
            return self.default
        if not (text.isascii() and text.isdigit()) or len(text) > _LONGEST_SHOWN or not int(text):
            raise ConfigurationError(
                self.variable,
                f'{text[:_LONGEST_SHOWN]!r} is no positive whole number',
                f'set it to a number of {self.unit}, or unset it',
            )
        return int(text)

    def exceeded(
        self, amount: int | None, kind: type[NanorocksError], where: str
    ) -> NanorocksError:
        """The error for an amount above the limit.

        Parameters
        ----------
        amount : int or None
            None if it is only known to be above the limit.
        kind : type of NanorocksError
        where : str
            The file.
        """
        claimed = f'{amount}' if amount is not None else f'more than {self.value}'
        return kind(
            where,
            f'{self.quantity}: {claimed} {self.unit}, above the limit of {self.value}',
            f'check where it comes from; if you trust it, set {self.variable} to more',
        )

    def check(self, amount: int, where: str, kind: type[NanorocksError] = RecordingError) -> None:
        """Raise if an amount is above the limit.

        Raises
        ------
        NanorocksError
            Of `kind`.
        """
        if amount > self.value:
            raise self.exceeded(amount, kind, where)


_MIB = 1 << 20

CHUNK_BYTES = Limit(
    name='chunk_bytes',
    default=128 * _MIB,
    unit='bytes',
    quantity='a chunk or message of a recording, unpacked',
)
CHUNK_RATIO = Limit(
    name='chunk_ratio',
    default=10_000,
    unit='times its size',
    quantity='unpacked size of a chunk above 64 MiB',
)
CHUNK_MESSAGES = Limit(
    name='chunk_messages',
    default=1_000_000,
    unit='messages',
    quantity='messages in a chunk of a recording',
)
RECORD_RATIO = Limit(
    name='record_ratio',
    default=1,
    unit='for each byte of it',
    quantity='messages and other records in a chunk of more than 1,000',
)
OVERLAP_BYTES = Limit(
    name='overlap_bytes',
    default=256 * _MIB,
    unit='bytes',
    quantity='chunks of a recording that overlap in time, unpacked',
)
SUMMARY_BYTES = Limit(
    name='summary_bytes',
    default=256 * _MIB,
    unit='bytes',
    quantity='index at the end of a recording',
)
HOLE_BYTES = Limit(
    name='hole_bytes',
    default=1 << 30,
    unit='bytes',
    quantity='size of a sparse file that is not on the disk',
)
SQLITE_STEPS = Limit(
    name='sqlite_steps',
    default=5_000_000_000,
    unit='steps',
    quantity='steps of a query of an SQLite recording',
)
TYPE_BYTES = Limit(
    name='type_bytes',
    default=256 << 10,
    unit='bytes',
    quantity='text of a message definition',
)
TYPE_FIELDS = Limit(
    name='type_fields',
    default=20_000,
    unit='fields',
    quantity='fields of a message type, with those of its components',
)
TYPE_DEPTH = Limit(
    name='type_depth',
    default=32,
    unit='levels',
    quantity='nesting of a message type',
)
IMAGE_PIXELS = Limit(
    name='image_pixels',
    default=1 << 26,
    unit='pixels',
    quantity='size of an image',
)
YAML_BYTES = Limit(
    name='yaml_bytes',
    default=16 * _MIB,
    unit='bytes',
    quantity='size of a YAML text',
)
YAML_NODES = Limit(
    name='yaml_nodes',
    default=1_000_000,
    unit='nodes',
    quantity='nodes of a YAML text, with its aliases written out',
)
YAML_DEPTH = Limit(
    name='yaml_depth',
    default=64,
    unit='levels',
    quantity='nesting of a YAML text',
)
BEADS = Limit(
    name='beads',
    default=1_000_000,
    unit='beads',
    quantity='beads of a species in a trays file',
)
DIGITS = Limit(
    name='digits',
    default=400,
    unit='digits',
    quantity='length of a number',
)
ARRAY_BYTES = Limit(
    name='array_bytes',
    default=768 * _MIB,
    unit='bytes',
    quantity='arrays of a file, unpacked',
)
TEXT_BYTES = Limit(
    name='text_bytes',
    default=256 * _MIB,
    unit='bytes',
    quantity='size of a JSON file',
)

PAUSE_SECONDS = Limit(
    name='pause_seconds',
    default=30 * 86_400,
    unit='seconds',
    quantity='time between two frames of a recording',
)

LIMITS = (
    CHUNK_BYTES,
    CHUNK_RATIO,
    CHUNK_MESSAGES,
    RECORD_RATIO,
    OVERLAP_BYTES,
    SUMMARY_BYTES,
    HOLE_BYTES,
    SQLITE_STEPS,
    TYPE_BYTES,
    TYPE_FIELDS,
    TYPE_DEPTH,
    IMAGE_PIXELS,
    YAML_BYTES,
    YAML_NODES,
    YAML_DEPTH,
    BEADS,
    DIGITS,
    ARRAY_BYTES,
    TEXT_BYTES,
    PAUSE_SECONDS,
)
"""Every limit; `docs/reference/limits.md` lists them."""


_OPENCV_VARIABLE = 'OPENCV_IO_MAX_IMAGE_PIXELS'


def bound_opencv() -> None:
    """Pass the limit of image sizes to OpenCV, unless the user has set its own variable.

    An invalid setting is reported when an image is read, not here.
    """
    text = os.environ.get(IMAGE_PIXELS.variable, '')
    usable = text.isascii() and text.isdigit() and len(text) <= _LONGEST_SHOWN
    os.environ.setdefault(_OPENCV_VARIABLE, text if usable else str(IMAGE_PIXELS.default))


def is_too_large(error: Exception) -> bool:
    """Whether OpenCV refused an image for its size."""
    return 'CV_IO_MAX_IMAGE' in str(error)


def require_regular_file(path: os.PathLike[str] | str, kind: type[NanorocksError]) -> None:
    """Raise for what is no regular file, and for sparse files that are nearly all hole.

    A FIFO or a device would be read forever; a sparse file claims a size that is nowhere.

    Parameters
    ----------
    path : path-like
        May be missing: that is reported by whoever opens it.
    kind : type of NanorocksError
        Raised.
    """
    try:
        status = os.stat(path)
    except OSError:
        return
    if stat.S_ISDIR(status.st_mode):
        return
    if not stat.S_ISREG(status.st_mode):
        raise kind(os.fspath(path), 'is no regular file', 'pass a file on a disk')
    hole = status.st_size - status.st_blocks * 512
    if hole > status.st_size // 2:
        HOLE_BYTES.check(hole, os.fspath(path), kind)
