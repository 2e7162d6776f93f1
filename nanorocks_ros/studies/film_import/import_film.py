"""Videos and folders of images, made into one recording."""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from nanorocks_ros import __version__
from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import offered
from nanorocks_ros.recordings.bag.provenance import checksum
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.film.duplicate_frames import Repeats
from nanorocks_ros.recordings.film.film_source import NS, Shot, StoredPicture, stored
from nanorocks_ros.recordings.film.timestamp_repair import Stamped, Steady
from nanorocks_ros.recordings.messages.camera_info import info_message
from nanorocks_ros.recordings.messages.iso8601 import instant_text
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.studies.film_import.film_inputs import (
    ImportSettings,
    check_order,
    check_sizes,
    open_film,
)
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from nanorocks_ros.recordings.film.film_source import Film

FRAME_ID = 'camera'
# Where neither the film nor the user says when it was taken: as simulated recordings begin.
_UNKNOWN_START_NS = 1_000_000_000_000_000_000
# Clocks of cameras count whole seconds: parts of a film that are closer follow each other.
_APART_NS = 3 * NS // 2
_USUAL_STEP_NS = NS // 30
# Pictures being compressed for each core, so that none waits for the file.
_AHEAD = 2


@dataclass(slots=True, kw_only=True)
class Imported:
    """What became of films.

    Parameters
    ----------
    bag : Path
    frames : int
        Pictures in the bag.
    duplicates_dropped : int
        Pictures that were stored twice.
    broken : int
        Pictures that could not be used.
    start_ns, end_ns : int, [ns]
        Stamps of the first and the last picture.
    notices : list of str
        What the user should know.
    provenance : dict of str to str
        As kept in the bag.
    """

    bag: Path
    frames: int = 0
    duplicates_dropped: int = 0
    broken: int = 0
    start_ns: int = 0
    end_ns: int = 0
    notices: list[str] = field(default_factory=list)
    provenance: dict[str, str] = field(default_factory=dict)

    @property
    def duration(self) -> float:
        """From the first picture to the last, [s]."""
        return (self.end_ns - self.start_ns) / NS


def import_films(
    paths: Sequence[Path],
    bag: Path,
    settings: ImportSettings,
    progress: Callable[[float], None],
) -> Imported:
    """Make one recording of the parts of a film.

    When it is interrupted, the bag holds what was written until then.

    Parameters
    ----------
    paths : sequence of Path
        In order of time.
    bag : Path
        Must not exist.
    settings : ImportSettings
    progress : callable
        Called with the share that is done.

    Returns
    -------
    Imported

    Raises
    ------
    ConfigurationError
        When the settings do not fit the films.
    RecordingError
        When a film cannot be read or the bag cannot be written.
    """
    films = [open_film(path, settings) for path in paths]
    check_sizes(films, settings)
    check_order(films, settings)
    # Now, not after the work.
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
        self._result = Imported(bag=bag)
        self._workers = settings.threads or os.cpu_count() or 1
        self._end_ns: int | None = None
        self._step_ns = _USUAL_STEP_NS
        self._done = 0.0

    def run(self) -> Imported:
        result = self._result
        image, lens = topics.RAW_COMPRESSED, topics.CAMERA_INFO
        table = {topic.absolute(): offered(topic) for topic in (image, lens)}
        result.provenance = self._provenance()
        with (
            ThreadPoolExecutor(self._workers + 1) as pool,
            BagWriter(result.bag, table, metadata=result.provenance) as bag,
        ):
            sums = [pool.submit(checksum, film.info.files) for film in self._films]
            try:
                self._write(bag, pool)
                self._remark(bag, {'source_sha256': ' '.join(one.result() for one in sums)})
                self._remark(bag, self._outcome())
            finally:
                pool.shutdown(wait=False, cancel_futures=True)
        if not result.frames:
            raise RecordingError(
                ', '.join(str(film.info.path) for film in self._films),
                'hold no picture that can be used',
                'check that they were copied whole',
            )
        return result

    def _write(self, bag: BagWriter, pool: ThreadPoolExecutor) -> None:
        result = self._result
        name = topics.RAW_COMPRESSED.absolute()
        for stamp_ns, picture in _in_order(self._shots(), pool, self._settings, self._workers):
            if not result.frames:
                result.start_ns = stamp_ns
                self._write_lens(bag, stamp_ns)
            message = compressed_image_message(stamp_ns, FRAME_ID, picture.form, picture.content)
            bag.write(name, stamp_ns, message)
            result.frames += 1
            result.end_ns = stamp_ns

    def _write_lens(self, bag: BagWriter, stamp_ns: int) -> None:
        if self._settings.calibration is not None:
            message = info_message(self._settings.calibration.info, stamp_ns, FRAME_ID)
            bag.write(topics.CAMERA_INFO.absolute(), stamp_ns, message)

    def _shots(self) -> Iterator[Stamped[Shot]]:
        done, whole = 0, max(1, sum(self._sizes))
        for number, (film, size) in enumerate(zip(self._films, self._sizes, strict=True)):
            self._result.notices += film.info.remarks
            for shot in self._shots_of(film, number):
                # Pictures that were sorted come from further behind.
                self._done = max(self._done, min(1.0, (done + size * shot.item.done) / whole))
                self._progress(self._done)
                yield shot
            done += size
            self._tell_losses(film)

    def _shots_of(self, film: Film, number: int) -> Iterator[Stamped[Shot]]:
        """The pictures of a film with their stamps, each once."""
        steady: Steady[Shot] = Steady(film.info.step_ns or self._step_ns)
        repeats = Repeats()
        shift_ns: int | None = None
        timed = ((shot.time_ns, shot) for shot in film.shots())
        for stamp_ns, shot in repeats.without(steady.stamps(timed)):
            if shift_ns is None:
                shift_ns = self._start_ns(film, number) - stamp_ns
            yield Stamped(stamp_ns + shift_ns, shot)
        # The film goes on to the last picture read, were it the same as those before it.
        if shift_ns is not None and steady.last_ns is not None:
            self._end_ns, self._step_ns = steady.last_ns + shift_ns, steady.usual_ns()
        self._tell_repairs(film, steady, repeats)

    def _start_ns(self, film: Film, number: int) -> int:
        """When the first picture of a film was taken; known ones are told."""
        notices, info = self._result.notices, film.info
        if self._end_ns is None:
            if self._settings.start_ns is not None:
                return self._settings.start_ns
            if info.start_ns is not None:
                return info.start_ns
            notices.append(
                f'{info.path}: does not say when it was taken; its stamps begin at '
                f'{instant_text(_UNKNOWN_START_NS)}; pass --start to give the instant'
            )
            return _UNKNOWN_START_NS
        following = self._end_ns + self._step_ns
        own = info.start_ns if self._settings.start_ns is None else None
        if own is not None and own - following > _APART_NS:
            gap = (own - self._end_ns) / NS
            notices.append(f'{info.path}: begins {gap:.1f} s after the part before it')
            return own
        return following

    def _tell_repairs(self, film: Film, steady: Steady[Shot], repeats: Repeats) -> None:
        self._result.duplicates_dropped += repeats.dropped
        repairs = steady.repairs
        said = (
            (repeats.dropped, 'frames were stored twice and left out'),
            (repairs.missing, 'frames have no time; they are stamped between their neighbours'),
            (repairs.reordered, 'frames came out of order and were sorted by their times'),
            (repairs.replaced, 'frames have a time that cannot be; stamped by their neighbours'),
            (repairs.set_back, 'times the clock was set back; it goes on from there'),
        )
        where = film.info.path
        self._result.notices += [f'{where}: {count} {what}' for count, what in said if count]
        if repeats.still_ns > NS:
            still = f'the picture stood still for {repeats.still_ns / NS:.1f} s'
            self._result.notices.append(f'{where}: {still}; of that a frame a second was kept')

    def _tell_losses(self, film: Film) -> None:
        self._result.broken += film.broken
        if film.broken:
            what = 'frames are damaged or of another size and were left out'
            self._result.notices.append(f'{film.info.path}: {film.broken} {what}')

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
            'pictures': 'as stored' if unchanged else picture_words(settings),
            **{f'import.{name}': value for name, value in settings.given().items() if value},
            **{f'camera.{k}': v for info in infos[:1] for k, v in info.tags.items()},
        }

    def _outcome(self) -> dict[str, str]:
        result = self._result
        return {
            'import': 'complete',
            'duplicates_dropped': str(result.duplicates_dropped),
            'damaged_frames': str(result.broken),
            'notices': '\n'.join(result.notices),
        }

    def _remark(self, bag: BagWriter, remarks: dict[str, str]) -> None:
        for key, value in remarks.items():
            bag.remark(key, value)
        self._result.provenance |= remarks


def _in_order(
    shots: Iterable[Stamped[Shot]],
    pool: ThreadPoolExecutor,
    settings: ImportSettings,
    workers: int,
) -> Iterator[tuple[int, StoredPicture]]:
    """Pictures as the bag holds them; those that are compressed, on all cores."""
    waiting: deque[tuple[int, Future[StoredPicture]]] = deque()
    for stamp_ns, shot in shots:
        if isinstance(shot.picture, StoredPicture) and not waiting:
            yield stamp_ns, shot.picture
            continue
        waiting.append((stamp_ns, pool.submit(stored, shot.picture, settings.quality)))
        if len(waiting) > _AHEAD * workers:
            first_ns, future = waiting.popleft()
            yield first_ns, future.result()
    for stamp_ns, future in waiting:
        yield stamp_ns, future.result()


def picture_words(settings: ImportSettings) -> str:
    """How pictures were compressed, as provenance says it."""
    return f'JPEG of quality {settings.quality}'


def as_json(imported: Imported) -> dict[str, Any]:
    """What became of films, as the command-line contract wants it."""
    return {
        'frames': imported.frames,
        'duplicates_dropped': imported.duplicates_dropped,
        'duration': imported.duration,
        'bag': str(imported.bag),
        'start': imported.start_ns / NS,
        'frames_damaged': imported.broken,
        'pictures': imported.provenance['pictures'],
        'notices': imported.notices,
    }
