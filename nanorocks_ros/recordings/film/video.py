"""Video files: their frames, upright and with square pixels, and their time stamps.

Tested by ``test/studies/film_import/test_import_times.py``.
"""

from __future__ import annotations

import shlex
from collections import deque
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.limits import IMAGE_PIXELS, require_regular_file
from nanorocks_ros.recordings.film.display_rotation import UNROTATED, rotation_of, rotation_text
from nanorocks_ros.recordings.film.film_losses import FilmLosses, cut_end, stated_duration
from nanorocks_ros.recordings.film.film_source import (
    EncodedImage,
    FilmFrame,
    FilmInfo,
    image_format,
)
from nanorocks_ros.recordings.film.pyav import pyav
from nanorocks_ros.recordings.film.video_picture import VideoPicture
from nanorocks_ros.recordings.film.video_streams import (
    FORMATS,
    creation_time_ns,
    declared_rate,
    frame_interval_ns,
    select_stream,
    square_size,
)
from nanorocks_ros.recordings.jpeg_header import is_whole_jpeg, jpeg_head, with_huffman_tables
from nanorocks_ros.recordings.messages.image_messages import is_decodable
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# A playlist must not make FFmpeg fetch anything from the network.
_ONLY_FILES = {'protocol_whitelist': 'file,crypto,data'}
_STRICT = {'err_detect': 'explode'}
_CAMERA_TAGS = ('make', 'model', 'comment', 'encoder', 'location')


class Video:
    """A video file.

    Parameters
    ----------
    path : Path
    rate : Fraction or None, [1/s]
        Frame rate of the camera; None: the time stamps or the rate in the video.
    threads : int
        Number of decoder threads; 0: one per core.

    Attributes
    ----------
    info : FilmInfo
    damaged : int
        Number of unusable frames so far.

    Raises
    ------
    ConfigurationError
        If PyAV is not installed, or the video has neither time stamps nor a frame rate.
    RecordingError
        If it is not a readable video.
    """

    def __init__(self, path: Path, rate: Fraction | None = None, threads: int = 0) -> None:
        require_regular_file(path, RecordingError)
        self.damaged = 0
        self._losses = FilmLosses(0, 0.0)
        self._threads = threads
        self._av = pyav(str(path))
        self._bytes = path.stat().st_size
        self._rotation = UNROTATED
        self._sides = self._square = (0, 0)
        with self._opened(path) as container:
            self._stream_index, remarks = select_stream(path, container)
        # Opened again because the selection may have read packets.
        with self._opened(path) as container:
            stream = container.streams.video[self._stream_index]
            if stream.codec_context is None:
                raise RecordingError(
                    str(path), 'is in a format that cannot be decoded', 'pass another video'
                )
            declared = None if rate else declared_rate(path, container, stream)
            self._rate = rate or declared
            self.info = self._film_info(path, container, stream)
        if declared is not None:
            notice = f'has no time stamps; its frame rate of {float(declared):.6g} Hz is used'
            remarks += (f'{path}: {notice}',)
        self.info.remarks = remarks + self.info.remarks

    def _opened(self, path: Path) -> Any:
        try:
            # Metadata of old cameras may not be UTF-8.
            container = self._av.open(
                f'file:{path.resolve()}',
                # Not `options`: they apply to streams, too, and PyAV overruns a buffer if streams
                # appear only after the file header, as in FLV.
                container_options=dict(_ONLY_FILES),
                metadata_errors='backslashreplace',
            )
        except (self._av.FFmpegError, OSError) as error:
            raise RecordingError(
                str(path),
                f'is not a readable video ({_reason(error)})',
                'check that it was copied completely, or pass another video',
            ) from error
        streams = container.streams.video
        if not streams or container.format.name not in FORMATS:
            container.close()
            raise RecordingError(str(path), 'holds no film', 'pass a video')
        return container

    def _film_info(self, path: Path, container: Any, stream: Any) -> FilmInfo:
        first, packet = self._first_frame(path, container, stream)
        self._rotation = rotation_of(first)
        self._sides = first.width, first.height
        width, height = self._square = square_size(path, stream, self._sides)
        info = FilmInfo(
            path=path,
            files=(path,),
            codec=stream.codec_context.name,
            width=height if self._rotation[0] == 0 else width,
            height=width if self._rotation[0] == 0 else height,
            step_ns=round(NS / self._rate) if self._rate else frame_interval_ns(stream),
            start_ns=creation_time_ns({**stream.metadata, **container.metadata}),
            expected=max(0, stream.frames),
            tags={k: v for k, v in container.metadata.items() if k.lower() in _CAMERA_TAGS},
        )
        unchanged = self._rotation == UNROTATED and self._square == self._sides
        info.as_stored = unchanged and self._is_jpeg(packet, info)
        info.remarks = self._remarks(info)
        if first.interlaced_frame:
            info.remarks += (_interlaced(path),)
        return info

    def _first_frame(self, path: Path, container: Any, stream: Any) -> tuple[Any, bytes]:
        """The first frame that can be decoded, and the packet that completed it."""
        context = stream.codec_context
        IMAGE_PIXELS.check(context.width * context.height, str(path))
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
            str(path),
            'holds no frame that can be decoded',
            'check that it was copied completely',
        )

    def _is_jpeg(self, content: bytes, info: FilmInfo) -> bool:
        """Whether a packet is a complete JPEG of the frame size; two fields in one are not."""
        head = jpeg_head(content) if info.codec == 'mjpeg' else None
        if head is None or (head.width, head.height) != (info.width, info.height):
            return False
        return is_decodable(with_huffman_tables(content, head))

    def _remarks(self, info: FilmInfo) -> tuple[str, ...]:
        recompressed = '; its JPEGs are recompressed for this' if info.codec == 'mjpeg' else ''
        changes = []
        if self._square != self._sides:
            stored, square = (
                f'{width}x{height} px' for width, height in (self._sides, self._square)
            )
            changes.append(f'its pixels are not square; stretched from {stored} to {square}')
        if self._rotation != UNROTATED:
            changes.append(f'{rotation_text(self._rotation)} according to its rotation flag')
        return tuple(f'{info.path}: {change}{recompressed}' for change in changes)

    @property
    def losses(self) -> tuple[str, ...]:
        """What is missing of the film, in sentences; final once its frames have been read."""
        return tuple(self._losses.sentences())

    def frames(self) -> Iterator[FilmFrame]:
        """Usable frames in the order of the film.

        Yields
        ------
        FilmFrame
        """
        with self._opened(self.info.path) as container:
            stream = container.streams.video[self._stream_index]
            self._losses = FilmLosses(
                self.info.expected,
                stated_duration(container, stream),
                cut_end=cut_end(self.info.path, container),
                timed=self._rate is None,
            )
            for number, frame in enumerate(self._stored_or_decoded_frames(container, stream)):
                if self._rate is None:
                    yield frame
                    continue
                # Damaged frames count, because the camera took them.
                yield frame._replace(time_ns=round((number + self.damaged) * NS / self._rate))

    def _stored_or_decoded_frames(self, container: Any, stream: Any) -> Iterator[FilmFrame]:
        if self.info.as_stored:
            return self._stored_frames(container, stream)
        stream.thread_type = 'AUTO'
        stream.codec_context.thread_count = self._threads
        # Otherwise the decoder fills what it cannot decode with parts of other frames.
        stream.codec_context.options = dict(_STRICT)
        return self._decoded_frames(container, stream)

    def _stored_frames(self, container: Any, stream: Any) -> Iterator[FilmFrame]:
        for packet, done in self._read(container, stream):
            if not packet.size or packet.is_discard:
                continue
            content = bytes(packet)
            head = jpeg_head(content)
            if head is None or not (self._fits(head) and is_whole_jpeg(content)):
                self.damaged += 1
                continue
            picture = EncodedImage(
                image_format('jpeg', head.channels), with_huffman_tables(content, head)
            )
            yield FilmFrame(_shown_ns(packet, stream), picture, done)

    def _decoded_frames(self, container: Any, stream: Any) -> Iterator[FilmFrame]:
        # An AVI has decoding times only. Presentation times are the same values, but in the order
        # in which the decoder returns the frames.
        decoded: deque[int | None] | None = deque() if container.format.name == 'avi' else None
        for packet, done in self._read(container, stream):
            if decoded is not None and packet.size:
                decoded.append(_nanoseconds(packet.dts, packet, stream))
            try:
                frames = packet.decode()
            except (self._av.FFmpegError, EOFError):
                self.damaged += 1
                continue
            for frame in frames:
                time_ns = decoded.popleft() if decoded else _shown_ns(frame, stream)
                if frame.is_corrupt or not self._fits(frame):
                    self.damaged += 1
                    continue
                yield FilmFrame(time_ns, VideoPicture(frame, self._square, self._rotation), done)

    def _fits(self, picture: Any) -> bool:
        """Whether a frame has the size of the first one."""
        return bool((picture.width, picture.height) == self._sides)

    def _read(self, container: Any, stream: Any) -> Iterator[tuple[Any, float]]:
        """Packets of a stream, each with the fraction of the file read so far."""
        packets = container.demux(stream)
        done = 0.0
        while True:
            try:
                packet = next(packets, None)
            except (self._av.FFmpegError, EOFError):
                self.damaged += 1
                return
            if packet is None:
                return
            # Those that are not shown and repeats without content are stated, too.
            if packet.size or packet.dts is not None:
                self._losses.note(_shown_ns(packet, stream))
            if packet.pos is not None and self._bytes:
                done = min(1.0, max(done, packet.pos / self._bytes))
            yield packet, done


def _interlaced(path: Path) -> str:
    """What to say of a film whose frames are marked as made of two fields."""
    progressive = shlex.quote(f'{path.stem}_progressive.mp4')
    return (
        f'{path}: is marked as interlaced, every second line from another time; if moving beads '
        'look like combs, speeds read low: set the camera to progressive, or '
        f'`ffmpeg -i {shlex.quote(str(path))} -vf bwdif=mode=send_field -crf 15 {progressive}`'
    )


def _reason(error: Exception) -> str:
    return str(getattr(error, 'strerror', None) or error)


def _shown_ns(source: Any, stream: Any) -> int | None:
    """Presentation time of a packet or frame; if it has none, its decoding time."""
    time = source.pts if source.pts is not None else source.dts
    return _nanoseconds(time, source, stream)


def _nanoseconds(time: int | None, source: Any, stream: Any) -> int | None:
    time_base = source.time_base or stream.time_base
    if time is None or not time_base:
        return None
    time_ns: int = round(time * Fraction(time_base) * NS)
    return time_ns
