"""A video: its pictures, turned upright, and when they were taken by its own clock."""

from __future__ import annotations

from collections import deque
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.film.display_rotation import UPRIGHT, turn_of, words_of
from nanorocks_ros.recordings.film.film_source import NS, FilmInfo, Shot, StoredPicture, form_of
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.recordings.film.video_picture import VideoPicture
from nanorocks_ros.recordings.film.video_streams import (
    FORMATS,
    film_among,
    rate_told,
    square_size,
    start_ns,
    step_ns,
)
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg, jpeg_head, with_huffman_tables
from nanorocks_ros.recordings.messages.image_messages import is_decodable

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Nothing is fetched because a playlist says so.
_ONLY_FILES = {'protocol_whitelist': 'file,crypto,data'}
_CAMERA_TAGS = ('make', 'model', 'comment', 'encoder', 'location')


class Video:
    """A video file.

    Parameters
    ----------
    path : Path
    rate : Fraction or None, [1/s]
        Of the camera; None: as the video says.
    threads : int
        That decode it; 0: as many as there are cores.

    Attributes
    ----------
    info : FilmInfo
    broken : int
        Pictures that could not be used, so far.

    Raises
    ------
    ConfigurationError
        When PyAV is not installed, or nothing says when the pictures were taken.
    RecordingError
        When it is no video.
    """

    def __init__(self, path: Path, rate: Fraction | None = None, threads: int = 0) -> None:
        self.broken = 0
        self._threads = threads
        self._av = pyav(str(path))
        self._bytes = path.stat().st_size
        self._turn = UPRIGHT
        self._sides = self._square = (0, 0)
        with self._opened(path) as container:
            self._place, remarks = film_among(path, container)
        # Again from its beginning.
        with self._opened(path) as container:
            stream = container.streams.video[self._place]
            told = None if rate else rate_told(path, container, stream)
            self._rate = rate or told
            self.info = self._described(path, container, stream)
        if told is not None:
            said = f'has no times; its stream says {float(told):.6g} pictures per second'
            remarks += (f'{path}: {said}',)
        self.info.remarks = remarks + self.info.remarks

    def _opened(self, path: Path) -> Any:
        try:
            # Notes of old cameras need not be UTF-8.
            container = self._av.open(
                f'file:{path.resolve()}',
                # Not `options`: those are for streams, too, and where streams show up only after
                # the head of a file, as in FLV, PyAV writes beyond what it has room for.
                container_options=dict(_ONLY_FILES),
                metadata_errors='backslashreplace',
            )
        except (self._av.FFmpegError, OSError) as error:
            raise RecordingError(
                str(path),
                f'is no video that can be read ({_reason(error)})',
                'check that it was copied whole, or pass another',
            ) from error
        streams = container.streams.video
        if not streams or container.format.name not in FORMATS:
            container.close()
            raise RecordingError(str(path), 'holds no film', 'pass a video')
        return container

    def _described(self, path: Path, container: Any, stream: Any) -> FilmInfo:
        first, packet = self._first(path, container, stream)
        self._turn = turn_of(first)
        self._sides = first.width, first.height
        width, height = self._square = square_size(path, stream, self._sides)
        info = FilmInfo(
            path=path,
            files=(path,),
            codec=stream.codec_context.name,
            width=height if self._turn[0] == 0 else width,
            height=width if self._turn[0] == 0 else height,
            step_ns=round(NS / self._rate) if self._rate else step_ns(stream),
            start_ns=start_ns({**stream.metadata, **container.metadata}),
            expected=max(0, stream.frames),
            tags={k: v for k, v in container.metadata.items() if k.lower() in _CAMERA_TAGS},
        )
        as_they_are = self._turn == UPRIGHT and self._square == self._sides
        info.as_stored = as_they_are and self._is_jpeg(packet, info)
        info.remarks = self._remarks(info)
        return info

    def _first(self, path: Path, container: Any, stream: Any) -> tuple[Any, bytes]:
        packets = container.demux(stream)
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    break
                frames = packet.decode()
            except (self._av.FFmpegError, EOFError):
                continue
            if frames:
                return frames[0], bytes(packet)
        raise RecordingError(
            str(path), 'holds no picture that can be decoded', 'check that it was copied whole'
        )

    def _is_jpeg(self, content: bytes, info: FilmInfo) -> bool:
        """Whether its packets are pictures that others can show; two fields in one are not."""
        head = jpeg_head(content) if info.codec == 'mjpeg' else None
        if head is None or (head.width, head.height) != (info.width, info.height):
            return False
        return is_decodable(with_huffman_tables(content, head))

    def _remarks(self, info: FilmInfo) -> tuple[str, ...]:
        again = '; its JPEGs are compressed anew for that' if info.codec == 'mjpeg' else ''
        said = []
        if self._square != self._sides:
            stored, square = (
                f'{width}x{height} px' for width, height in (self._sides, self._square)
            )
            said.append(f'its pixels are not square; stretched from {stored} to {square}')
        if self._turn != UPRIGHT:
            said.append(f'{words_of(self._turn)}, as its rotation flag says')
        return tuple(f'{info.path}: {one}{again}' for one in said)

    def shots(self) -> Iterator[Shot]:
        """The pictures that can be used, in the order of the film.

        Yields
        ------
        Shot
        """
        with self._opened(self.info.path) as container:
            stream = container.streams.video[self._place]
            for number, shot in enumerate(self._stored_or_decoded(container, stream)):
                if self._rate is None:
                    yield shot
                    continue
                # With those that were lost: the camera took them.
                yield shot._replace(time_ns=round((number + self.broken) * NS / self._rate))

    def _stored_or_decoded(self, container: Any, stream: Any) -> Iterator[Shot]:
        if self.info.as_stored:
            return self._packets(container, stream)
        stream.thread_type = 'AUTO'
        stream.codec_context.thread_count = self._threads
        return self._frames(container, stream)

    def _packets(self, container: Any, stream: Any) -> Iterator[Shot]:
        for packet, done in self._read(container, stream):
            if not packet.size or packet.is_discard:
                continue
            content = bytes(packet)
            head = jpeg_head(content)
            if head is None or not (self._fits(head) and is_whole_jpeg(content)):
                self.broken += 1
                continue
            picture = StoredPicture(
                form_of('jpeg', head.channels), with_huffman_tables(content, head)
            )
            yield Shot(_shown_ns(packet, stream), picture, done)

    def _frames(self, container: Any, stream: Any) -> Iterator[Shot]:
        # An AVI knows when pictures are decoded, not when they are shown, which is in the same
        # order of time but in another order of pictures.
        decoded: deque[int | None] | None = deque() if container.format.name == 'avi' else None
        for packet, done in self._read(container, stream):
            if decoded is not None and packet.size:
                decoded.append(_nanoseconds(packet.dts, packet, stream))
            try:
                frames = packet.decode()
            except (self._av.FFmpegError, EOFError):
                self.broken += 1
                continue
            for frame in frames:
                time_ns = decoded.popleft() if decoded else _shown_ns(frame, stream)
                if frame.is_corrupt or not self._fits(frame):
                    self.broken += 1
                    continue
                yield Shot(time_ns, VideoPicture(frame, self._square, self._turn), done)

    def _fits(self, picture: Any) -> bool:
        """Whether it has the size that the film began with."""
        return bool((picture.width, picture.height) == self._sides)

    def _read(self, container: Any, stream: Any) -> Iterator[tuple[Any, float]]:
        packets = container.demux(stream)
        done = 0.0
        while True:
            try:
                packet = next(packets, None)
            except (self._av.FFmpegError, EOFError):
                self.broken += 1
                return
            if packet is None:
                return
            if packet.pos is not None and self._bytes:
                done = min(1.0, max(done, packet.pos / self._bytes))
            yield packet, done


def _reason(error: Exception) -> str:
    return str(getattr(error, 'strerror', None) or error)


def _shown_ns(source: Any, stream: Any) -> int | None:
    """When a packet or frame is to be shown; where it is not said, when it is to be decoded."""
    time = source.pts if source.pts is not None else source.dts
    return _nanoseconds(time, source, stream)


def _nanoseconds(time: int | None, source: Any, stream: Any) -> int | None:
    time_base = source.time_base or stream.time_base
    if time is None or not time_base:
        return None
    found: int = round(time * Fraction(time_base) * NS)
    return found
