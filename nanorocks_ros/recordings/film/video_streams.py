"""What a video file says of the film in it: its format, its rate, and when it was taken."""

from __future__ import annotations

import itertools
from collections import Counter
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.film_source import NS
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.recordings.messages.iso8601 import instant

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

# The library makes a film of texts and of noise, too, where it is let.
_CONTAINERS = 'mov,mp4,m4a,3gp,3g2,mj2 matroska,webm avi mpegts mpeg asf mxf flv ogg nut dv ivf'
# Nothing but pictures: the library stamps them at 25 per second where it knows no better.
_CODED, _JPEGS, _PLAIN = ('h264', 'hevc'), 'mjpeg', 'yuv4mpegpipe'
FORMATS = frozenset([*_CONTAINERS.split(), *_CODED, _JPEGS, _PLAIN])
"""Formats of files that are taken for films, as the library names them."""

_ENDINGS = (
    'mp4 m4v mov qt 3gp 3g2 mj2 f4v mkv webm avi divx ts mts m2ts m2t mpg mpeg vob asf wmv mxf '
    'flv ogv ogm nut dv dif ivf h264 264 avc hevc h265 265 mjpeg mjpg y4m'
)
VIDEOS = frozenset(f'.{ending}' for ending in _ENDINGS.split())
"""Endings of the files that a folder of videos is looked through for: those of all formats."""

# Films that are not read, and what films that are read begin with, whatever their names.
_OTHERS = frozenset(
    ['.m1v', '.m2v', '.mpv', '.rm', '.rmvb', '.amv', '.cine', '.r3d', '.braw', '.obu', '.vvc']
)
_HEAD_BYTES = 16
_STARTS = (b'\x1aE\xdf\xa3', b'FLV\x01', b'nut/multimedia', b'YUV4MPEG2 ', b'0&\xb2u\x8ef\xcf\x11')
_QUICKTIME, _NO_FILMS = b'ftyp', (b'heic', b'heix', b'mif1', b'avif', b'crx ', b'M4A ', b'M4B ')

# Flags of pictures that go with a film or with sound, as the library sets them: attached ones
# and those for a time line.
_COVERS = 0x400 | 0x800
# Packets of a file with several films that are looked at, and the share of the most pictures
# that a film has to have to be taken before others.
_LOOKED_AT, _AS_LONG = 2000, 0.9
_PLAIN_HEAD_BYTES = 256
# Streams cut out of films of a variable rate say the ticks of a clock instead, [1/s].
_TICKING = 1000
# Sides of pixels: what comes of rounding the size of a display, and what no lens stretches to.
_ROUNDED, _LONGEST = Fraction(1, 200), Fraction(4)
# Cameras without a clock begin in 1904 or 1970; stamps of messages end in 2038.
_FIRST_NS, _LAST_NS = 315_532_800 * NS, (2**31 - 1) * NS
# Whose clock knows its zone comes first.
_START_TAGS = ('com.apple.quicktime.creationdate', 'creation_time')


def looks_like_film(path: Path) -> bool:
    """Whether a file that has not the ending of a film may be one all the same.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    if path.suffix.lower() in _OTHERS:
        return True
    if path.suffix.lower() == '.mka' or not path.is_file():
        return False
    with path.open('rb') as file:
        head = file.read(_HEAD_BYTES)
    if head[4:8] == _QUICKTIME:
        return head[8:12] not in _NO_FILMS
    return head.startswith(_STARTS) or (head[:4] == b'RIFF' and head[8:11] == b'AVI')


def film_among(path: Path, container: Any) -> tuple[int, tuple[str, ...]]:
    """Which of the video streams is the film, and what the user should know of it.

    Parameters
    ----------
    path : Path
    container : object of PyAV
        Is read on where there is a choice.

    Raises
    ------
    RecordingError
        When there are but pictures that go with sound.
    """
    streams = container.streams.video
    places = [place for place, stream in enumerate(streams) if not _is_cover(stream)]
    if not places:
        raise RecordingError(str(path), 'holds no film, only a picture', 'pass a video')
    counts = _pictures_in(path, container, [streams[place] for place in places])
    # Of films that differ by the pictures at their ends, the first.
    place = next(
        place
        for place, count in zip(places, counts, strict=True)
        if count >= _AS_LONG * max(counts)
    )
    if len(streams) == 1:
        return place, ()
    said = f'holds {len(streams)} video streams; number {place + 1} is taken for the film'
    return place, (f'{path}: {said}',)


def _is_cover(stream: Any) -> bool:
    # Old versions of the library do not say it, others as a number or as an enumeration.
    what = getattr(stream, 'disposition', 0)
    return bool(int(getattr(what, 'value', what)) & _COVERS)


def _pictures_in(path: Path, container: Any, streams: Sequence[Any]) -> list[int]:
    """How many pictures each stream has in the part of the file that is looked at."""
    if len(streams) == 1:
        return [1]
    counts = Counter[int]()
    with suppress(pyav(str(path)).FFmpegError, EOFError):
        for packet in itertools.islice(container.demux(*streams), _LOOKED_AT):
            counts[packet.stream.index] += packet.size > 0
    return [counts[stream.index] for stream in streams]


def rate_told(path: Path, container: Any, stream: Any) -> Fraction | None:
    """The rate that a film without times says, [1/s]; None where pictures have times.

    Parameters
    ----------
    path : Path
    container, stream : objects of PyAV

    Raises
    ------
    ConfigurationError
        When there are neither times nor a rate.
    """
    form = container.format.name
    if form == _PLAIN and _plain_tells(path):
        return None
    if form not in (*_CODED, _JPEGS, _PLAIN):
        return None
    # Of the codec: what its stream says, and nothing where it does not; those of the stream
    # are then the 25 of the library.
    rate = stream.codec_context.framerate if form in _CODED else None
    if rate and rate < _TICKING:
        return Fraction(rate)
    raise ConfigurationError(
        str(path),
        'has no times, and does not say at which rate it was taken',
        'pass --rate, in pictures per second',
    )


def _plain_tells(path: Path) -> bool:
    """Whether the head of uncompressed video gives a rate; 0:0 means that it is not known."""
    with path.open('rb') as file:
        words = file.readline(_PLAIN_HEAD_BYTES).split()
    rates = [word[1:].split(b':') for word in words[1:] if word.startswith(b'F')]
    return any(all(part.strip(b'0') for part in one) for one in rates)


def square_size(path: Path, stream: Any, sides: tuple[int, int]) -> tuple[int, int]:
    """Width and height of pictures once their pixels are square, [px].

    The shorter side of the pixels is stretched, so that no detail is lost.

    Parameters
    ----------
    path : Path
    stream : object of PyAV
    sides : tuple of int, [px]
        Width and height as they are stored.

    Raises
    ------
    RecordingError
        When the pixels are of a shape that no camera has.
    """
    ratio = Fraction(stream.sample_aspect_ratio or 1)
    if abs(ratio - 1) <= _ROUNDED:
        return sides
    if not 1 / _LONGEST <= ratio <= _LONGEST:
        raise RecordingError(
            str(path),
            f'says that its pixels are {ratio.numerator}:{ratio.denominator}, wide to high',
            'write a copy of it that says what they are',
        )
    width, height = sides
    return (round(width * ratio), height) if ratio > 1 else (width, round(height / ratio))


def step_ns(stream: Any) -> int:
    """The usual time between two pictures, [ns]; 0 when unknown.

    Parameters
    ----------
    stream : object of PyAV
    """
    for rate in (stream.average_rate, stream.guessed_rate):
        if rate:
            return round(NS / Fraction(rate))
    return 0


def start_ns(tags: dict[str, str]) -> int | None:
    """When a film was taken, since 1970, [ns]; None where nothing says so.

    Parameters
    ----------
    tags : dict of str to str
        What the camera wrote into it.
    """
    for name in _START_TAGS:
        found = instant(tags.get(name, ''))
        if found is not None and _FIRST_NS <= found < _LAST_NS:
            return found
    return None
