"""Metadata of video files: format, stream, frame rate, aspect ratio, and time of recording.

Tested by ``test/studies/film_import/test_import_each.py``.
"""

from __future__ import annotations

import itertools
from collections import Counter
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.recordings.film.film_source import rate_remedy
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.recordings.messages.iso8601 import parse_iso8601
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

# FFmpeg would also decode text and noise, so only these formats are accepted.
_CONTAINERS = (
    'mov,mp4,m4a,3gp,3g2,mj2 matroska,webm avi mpegts mpeg asf mxf flv ogg nut dv ivf gif'
)
# Streams without a container; FFmpeg assumes 25 frames per second if it does not know the rate.
_RAW_CODECS, _RAW_JPEGS, _YUV4MPEG = ('h264', 'hevc'), 'mjpeg', 'yuv4mpegpipe'
FORMATS = frozenset([*_CONTAINERS.split(), *_RAW_CODECS, _RAW_JPEGS, _YUV4MPEG])
"""Accepted file formats, by their FFmpeg names."""

_ENDINGS = (
    'mp4 m4v mov qt 3gp 3g2 mj2 f4v mkv webm avi divx ts mts m2ts m2t mpg mpeg vob asf wmv mxf '
    'flv ogv ogm nut dv dif ivf gif h264 264 avc hevc h265 265 mjpeg mjpg y4m'
)
VIDEO_SUFFIXES = frozenset(f'.{ending}' for ending in _ENDINGS.split())
"""File extensions of videos in a folder: those of all accepted formats."""

# File extensions of videos that cannot be read, and first bytes of videos with another extension.
_UNSUPPORTED = frozenset(
    ['.m1v', '.m2v', '.mpv', '.rm', '.rmvb', '.amv', '.cine', '.r3d', '.braw', '.obu', '.vvc']
)
_HEAD_BYTES = 16
_STARTS = (b'\x1aE\xdf\xa3', b'FLV\x01', b'nut/multimedia', b'YUV4MPEG2 ', b'0&\xb2u\x8ef\xcf\x11')
_QUICKTIME, _NO_FILMS = b'ftyp', (b'heic', b'heix', b'mif1', b'avif', b'crx ', b'M4A ', b'M4B ')

# FFmpeg disposition flags of cover images: attached pictures and timed thumbnails.
_COVERS = 0x400 | 0x800
# Packets that are counted in a file with several video streams. The first stream with at least
# this fraction of the largest count is the film.
_COUNTED_PACKETS, _MIN_FRACTION = 2000, 0.9
_YUV4MPEG_HEADER_BYTES = 256
# Raw streams of variable-rate videos state the tick rate of a clock instead, [1/s].
_TICK_RATE = 1000
# Aspect ratios of pixels: largest deviation from 1 by rounding, and largest possible ratio.
_ROUNDING, _MAX_ASPECT = Fraction(1, 200), Fraction(4)
# Cameras without a clock start in 1904 or 1970; the time stamps of ROS end in 2038.
_FIRST_NS, _LAST_NS = 315_532_800 * NS, (2**31 - 1) * NS
# The tag with a time zone comes first.
_START_TAGS = ('com.apple.quicktime.creationdate', 'creation_time')


def looks_like_film(path: Path) -> bool:
    """Whether a file without the extension of a video may be a video.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if path.suffix.lower() in _UNSUPPORTED:
        return True
    if path.suffix.lower() == '.mka' or not path.is_file():
        return False
    with path.open('rb') as file:
        head = file.read(_HEAD_BYTES)
    if head[4:8] == _QUICKTIME:
        return head[8:12] not in _NO_FILMS
    return head.startswith(_STARTS) or (head[:4] == b'RIFF' and head[8:11] == b'AVI')


def select_stream(path: Path, container: Any) -> tuple[int, tuple[str, ...]]:
    """Index of the video stream to import, and notices for the user.

    Parameters
    ----------
    path : Path
    container : object of PyAV
        Is read if there are several streams.

    Raises
    ------
    RecordingError
        If all streams are cover images.
    """
    streams = container.streams.video
    candidates = [index for index, stream in enumerate(streams) if not _is_cover(stream)]
    if not candidates:
        raise RecordingError(str(path), 'holds no film, only a picture', 'pass a video')
    counts = _frame_counts(path, container, [streams[index] for index in candidates])
    # Streams of nearly the same length count as equal; the first is selected.
    selected = next(
        index
        for index, count in zip(candidates, counts, strict=True)
        if count >= _MIN_FRACTION * max(counts)
    )
    if len(streams) == 1:
        return selected, ()
    notice = f'holds {len(streams)} video streams; number {selected + 1} is imported'
    return selected, (f'{path}: {notice}',)


def _is_cover(stream: Any) -> bool:
    # Old versions of PyAV have no disposition; others return a number or an enumeration.
    disposition = getattr(stream, 'disposition', 0)
    return bool(int(getattr(disposition, 'value', disposition)) & _COVERS)


def _frame_counts(path: Path, container: Any, streams: Sequence[Any]) -> list[int]:
    """Number of frames of each stream in the first part of the file."""
    if len(streams) == 1:
        return [1]
    counts = Counter[int]()
    with suppress(pyav(str(path)).FFmpegError, EOFError):
        for packet in itertools.islice(container.demux(*streams), _COUNTED_PACKETS):
            counts[packet.stream.index] += packet.size > 0
    return [counts[stream.index] for stream in streams]


def declared_rate(path: Path, container: Any, stream: Any) -> Fraction | None:
    """Frame rate that a film without time stamps declares, [1/s]; None if frames have times.

    Parameters
    ----------
    path : Path
    container, stream : objects of PyAV

    Raises
    ------
    ConfigurationError
        If there are neither time stamps nor a frame rate.
    """
    file_format = container.format.name
    if file_format == _YUV4MPEG and _yuv4mpeg_has_rate(path):
        return None
    if file_format not in (*_RAW_CODECS, _RAW_JPEGS, _YUV4MPEG):
        return None
    # The rate of the codec is the declared one; that of the stream may be the 25 of FFmpeg.
    rate = stream.codec_context.framerate if file_format in _RAW_CODECS else None
    if rate and rate < _TICK_RATE:
        return Fraction(rate)
    raise ConfigurationError(
        str(path),
        'has neither time stamps nor a frame rate',
        rate_remedy(path),
    )


def _yuv4mpeg_has_rate(path: Path) -> bool:
    """Whether the header of uncompressed video states a rate; 0:0 means unknown."""
    with path.open('rb') as file:
        words = file.readline(_YUV4MPEG_HEADER_BYTES).split()
    rates = [word[1:].split(b':') for word in words[1:] if word.startswith(b'F')]
    return any(all(part.strip(b'0') for part in rate) for rate in rates)


def square_size(path: Path, stream: Any, sides: tuple[int, int]) -> tuple[int, int]:
    """Width and height of frames with square pixels, [px].

    The shorter side of the pixels is stretched, so that no detail is lost.

    Parameters
    ----------
    path : Path
    stream : object of PyAV
    sides : tuple of int, [px]
        Stored width and height.

    Raises
    ------
    RecordingError
        If the aspect ratio of the pixels is impossible.
    """
    ratio = Fraction(stream.sample_aspect_ratio or 1)
    if abs(ratio - 1) <= _ROUNDING:
        return sides
    if not 1 / _MAX_ASPECT <= ratio <= _MAX_ASPECT:
        raise RecordingError(
            str(path),
            f'states an impossible pixel aspect ratio, {ratio.numerator}:{ratio.denominator}',
            'write a copy with the true aspect ratio',
        )
    width, height = sides
    return (round(width * ratio), height) if ratio > 1 else (width, round(height / ratio))


def frame_interval_ns(stream: Any) -> int:
    """Usual time between two frames, [ns]; 0 if unknown.

    Parameters
    ----------
    stream : object of PyAV
    """
    for rate in (stream.average_rate, stream.guessed_rate):
        if rate:
            return round(NS / Fraction(rate))
    return 0


def creation_time_ns(tags: dict[str, str]) -> int | None:
    """Time of recording, since 1970, [ns]; None if it is unknown.

    Parameters
    ----------
    tags : dict of str to str
        Metadata written by the camera.
    """
    for name in _START_TAGS:
        time_ns = parse_iso8601(tags.get(name, ''))
        if time_ns is not None and _FIRST_NS <= time_ns < _LAST_NS:
            return time_ns
    return None
