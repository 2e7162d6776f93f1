"""Import of videos and folders of images into one recording."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.provenance import checksum
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.film.duplicate_frames import DuplicateFilter
from nanorocks_ros.recordings.film.film_source import EncodedImage, FilmFrame, encoded
from nanorocks_ros.recordings.film.timestamp_repair import Stamped, TimestampRepair
from nanorocks_ros.recordings.messages.camera_info import info_message
from nanorocks_ros.recordings.messages.iso8601 import format_iso8601
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.records import NS
from nanorocks_ros.studies.film_import.film_inputs import (
    ImportSettings,
    check_order,
    check_sizes,
    open_film,
)
from nanorocks_ros.studies.film_import.import_result import ImportResult
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from nanorocks_ros.recordings.film.film_source import Film

FRAME_ID = 'camera'
# Start if neither the film nor the user states one: that of simulated recordings.
_UNKNOWN_START_NS = 1_000_000_000_000_000_000
# Clocks of cameras count whole seconds: a shorter gap between parts of a film is ignored.
_MIN_GAP_NS = 3 * NS // 2
_DEFAULT_STEP_NS = NS // 30
# Frames queued for compression per core, so that no core waits for the file.
_QUEUED_PER_CORE = 2


def import_films(
    paths: Sequence[Path],
    bag: Path,
    settings: ImportSettings,
    progress: Callable[[float], None],
) -> ImportResult:
    """Import the parts of a film into one bag.

    If the import is interrupted, the bag contains the frames written until then.

    Parameters
    ----------
    paths : sequence of Path
        In order of time.
    bag : Path
        Must not exist.
    settings : ImportSettings
    progress : callable
        Called with the fraction that is done, 0 to 1.

    Returns
    -------
    ImportResult

    Raises
    ------
    ConfigurationError
        If the settings do not fit the films.
    RecordingError
        If a film cannot be read or the bag cannot be written.
    """
    films = [open_film(path, settings) for path in paths]
    check_sizes(films, settings)
    check_order(films, settings)
    if os.path.lexists(bag):
        raise RecordingError(
            str(bag), 'exists already and is not overwritten', 'pass another path'
        )
    return _Import(films, bag, settings, progress).run()


class _Import:
    """One import, from its films to its bag."""

    def __init__(
        self,
        films: Sequence[Film],
        bag: Path,
        settings: ImportSettings,
        progress: Callable[[float], None],
    ) -> None:
        self._films = films
        self._settings = settings
        self._progress = progress
        self._sizes = [sum(file.stat().st_size for file in film.info.files) for film in films]
        self._result = ImportResult(bag=bag)
        self._workers = settings.threads or os.cpu_count() or 1
        # Last stamp and usual step of the previous part.
        self._end_ns: int | None = None
        self._step_ns = _DEFAULT_STEP_NS
        self._done = 0.0

    def run(self) -> ImportResult:
        result = self._result
        image, lens = topics.RAW_COMPRESSED, topics.CAMERA_INFO
        offered_topics = {topic.absolute(): offered_topic(topic) for topic in (image, lens)}
        result.provenance = self._provenance()
        with (
            ThreadPoolExecutor(self._workers + 1) as pool,
            BagWriter(result.bag, offered_topics, metadata=result.provenance) as bag,
        ):
            sums = [pool.submit(checksum, film.info.files) for film in self._films]
            try:
                self._write(bag, pool)
                checksums = ' '.join(future.result() for future in sums)
                self._set_metadata(bag, {'source_sha256': checksums})
                self._set_metadata(bag, result.outcome())
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
        if not result.frames:
            raise RecordingError(
                ', '.join(str(film.info.path) for film in self._films),
                'contain no usable frame',
                'check that they were copied completely',
            )
        return result

    def _write(self, bag: BagWriter, pool: ThreadPoolExecutor) -> None:
        result = self._result
        name = topics.RAW_COMPRESSED.absolute()
        for stamp_ns, picture in _compressed(self._frames(), pool, self._settings, self._workers):
            if not result.frames:
                result.start_ns = stamp_ns
                self._write_lens(bag, stamp_ns)
            message = compressed_image_message(stamp_ns, FRAME_ID, picture.format, picture.content)
            bag.write(name, stamp_ns, message)
            result.frames += 1
            result.end_ns = stamp_ns

    def _write_lens(self, bag: BagWriter, stamp_ns: int) -> None:
        if self._settings.calibration is not None:
            message = info_message(self._settings.calibration.info, stamp_ns, FRAME_ID)
            bag.write(topics.CAMERA_INFO.absolute(), stamp_ns, message)

    def _frames(self) -> Iterator[Stamped[FilmFrame]]:
        read, total = 0, max(1, sum(self._sizes))
        for film, size in zip(self._films, self._sizes, strict=True):
            self._result.notices += film.info.remarks
            for frame in self._frames_of(film):
                # Reordered frames were read earlier than the frame before them.
                self._done = max(self._done, min(1.0, (read + size * frame.item.done) / total))
                self._progress(self._done)
                yield frame
            read += size
            self._result.add_damaged(film)

    def _frames_of(self, film: Film) -> Iterator[Stamped[FilmFrame]]:
        """Frames of a film with repaired stamps, without duplicates."""
        repair: TimestampRepair[FilmFrame] = TimestampRepair(film.info.step_ns or self._step_ns)
        duplicates = DuplicateFilter()
        shift_ns: int | None = None
        timed = ((frame.time_ns, frame) for frame in film.frames())
        for stamp_ns, frame in duplicates.filter(repair.repaired(timed)):
            if shift_ns is None:
                shift_ns = self._start_ns(film) - stamp_ns
            yield Stamped(stamp_ns + shift_ns, frame)
        # The last frame ends the film, even if it is a duplicate.
        if shift_ns is not None and repair.last_ns is not None:
            self._end_ns, self._step_ns = repair.last_ns + shift_ns, repair.usual_ns()
        self._result.add_repairs(film, repair.repairs, duplicates)

    def _start_ns(self, film: Film) -> int:
        """Stamp of the first frame of a film."""
        notices, info = self._result.notices, film.info
        if self._end_ns is None:
            if self._settings.start_ns is not None:
                return self._settings.start_ns
            if info.start_ns is not None:
                return info.start_ns
            notices.append(
                f'{info.path}: the time of recording is unknown; the stamps start at '
                f'{format_iso8601(_UNKNOWN_START_NS)}; `nanorocks import --start` sets it'
            )
            return _UNKNOWN_START_NS
        next_ns = self._end_ns + self._step_ns
        start_ns = info.start_ns if self._settings.start_ns is None else None
        if start_ns is not None and start_ns - next_ns > _MIN_GAP_NS:
            gap = (start_ns - self._end_ns) / NS
            notices.append(f'{info.path}: starts {gap:.1f} s after the end of the previous part')
            return start_ns
        return next_ns

    def _provenance(self) -> dict[str, str]:
        infos = [film.info for film in self._films]
        settings = self._settings
        unchanged = all(info.as_stored for info in infos)
        return {
            'nanorocks_ros': __version__,
            'import': 'unfinished',
            'source': ', '.join(info.path.name for info in infos),
            'source_bytes': ' '.join(str(size) for size in self._sizes),
            'codec': ', '.join(info.codec for info in infos),
            'pictures': 'as stored' if unchanged else settings.compression(),
            **{f'import.{name}': value for name, value in settings.as_metadata().items() if value},
            **{f'camera.{k}': v for info in infos[:1] for k, v in info.tags.items()},
            **settings.experiment,
        }

    def _set_metadata(self, bag: BagWriter, metadata: dict[str, str]) -> None:
        for key, value in metadata.items():
            bag.set_metadata(key, value)
        self._result.provenance |= metadata


def _compressed(
    frames: Iterable[Stamped[FilmFrame]],
    pool: ThreadPoolExecutor,
    settings: ImportSettings,
    workers: int,
) -> Iterator[tuple[int, EncodedImage]]:
    """Stamps and encoded images, in order; images are compressed on all cores."""
    queue: deque[tuple[int, Future[EncodedImage]]] = deque()
    for stamp_ns, frame in frames:
        if isinstance(frame.picture, EncodedImage) and not queue:
            yield stamp_ns, frame.picture
            continue
        queue.append((stamp_ns, pool.submit(encoded, frame.picture, settings.quality)))
        if len(queue) > _QUEUED_PER_CORE * workers:
            first_ns, future = queue.popleft()
            yield first_ns, future.result()
    for stamp_ns, future in queue:
        yield stamp_ns, future.result()
