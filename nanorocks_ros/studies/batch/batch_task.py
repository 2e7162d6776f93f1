"""One recording of a batch: its analysis, results and summary.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import json
import time
import traceback
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import cv2

from nanorocks_ros.errors import NanorocksError, RecordingError, UnwritableError
from nanorocks_ros.experiment.recorded_experiment import (
    RecordedSettings,
    metadata_of_settings,
    recorded_settings,
)
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.outputs.safe_text import printable
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.recordings.bag.fingerprint import FileState, content_hash, file_states
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.analysis.results.results_folder import EVIDENCE, SUMMARY, write_results
from nanorocks_ros.studies.batch.bag_summary import (
    FAILED,
    FORMAT,
    UNWRITTEN,
    BagSummary,
    cycles_by_measure,
    evidence_arrays,
    read_summary,
    summary_of,
)
from nanorocks_ros.studies.batch.batch_statistics import TrackCollector, write_statistics

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.settings import PipelineSettings

TROUBLE = 'trouble.txt'
# Interval of progress notes, [s].
_NOTE = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BagTask:
    """A recording to analyse.

    Parameters
    ----------
    path : Path
        Absolute; so are the others: a worker may be elsewhere.
    folder : Path
        For its results.
    settings : PipelineSettings
    image_topic : str
    told : frozenset of str or None
        Names of the settings that hold for all recordings; a recording that says what it shows
        replaces the others. None: all of them hold.
    statistics : bool
        Whether to measure the statistics of the gas, too.
    question : str
        Hash of all else that results depend on.
    note : Path
        Where it says how far it has come: frames done and in all.
    earlier : tuple of Path
        Folders that may hold its results, from when it lay elsewhere.
    """

    path: Path
    folder: Path
    settings: PipelineSettings
    image_topic: str
    question: str
    note: Path
    earlier: tuple[Path, ...] = ()
    told: frozenset[str] | None = None
    statistics: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BagOutcome:
    """The outcome of a task.

    Parameters
    ----------
    state : str
        `DONE`; `PARTIAL`: there are results, but some frames could not be used; `FAILED`: there
        are none; `UNWRITTEN`: none could be written.
    reason : str
        One line, unless it is done.
    content : str
        Hash of the recording; empty where it could not be read.
    files : tuple of FileState
    frames : int
        Analysed by this call.
    folder : str
        Name of the folder of its results where that is not the one of the task.
    """

    state: str
    reason: str = ''
    content: str = ''
    files: tuple[FileState, ...] = ()
    frames: int = 0
    folder: str = ''


def analyse_bag(task: BagTask) -> BagOutcome:
    """Analyse a recording and write its results, complete or not at all; it never raises."""
    # Other recordings use the other cores.
    cv2.setNumThreads(1)
    try:
        return _analysed(task)
    except UnwritableError as error:
        return BagOutcome(state=UNWRITTEN, reason=printable(str(error)))
    except NanorocksError as error:
        return BagOutcome(state=FAILED, reason=printable(str(error)))
    except MemoryError:
        return BagOutcome(
            state=FAILED, reason=f'{printable(task.path)}: takes more memory than is left'
        )
    except OSError as error:
        return BagOutcome(
            state=FAILED, reason=f'{printable(task.path)}: cannot be read ({error.strerror})'
        )
    except Exception as error:
        # A bug shown by one recording must not end the others.
        place = task.folder.with_name(f'{task.folder.name}.{TROUBLE}')
        with suppress(OSError):
            place.write_text(traceback.format_exc(), 'utf-8', 'backslashreplace')
        fault = printable(' '.join(f'{type(error).__name__}: {error}'.split()))
        return BagOutcome(
            state=FAILED,
            reason=f'{printable(task.path)}: cannot be analysed ({fault}); please report {place}',
        )
    finally:
        with suppress(OSError):
            task.note.unlink(missing_ok=True)


def _analysed(task: BagTask) -> BagOutcome:
    files = file_states(task.path)
    content = content_hash(task.path)
    for folder in (task.folder, *task.earlier):
        stored = read_summary(folder)
        if stored is not None and (stored['content'], stored['question']) == (
            content,
            task.question,
        ):
            other = '' if folder == task.folder else folder.name
            return replace(_outcome(stored, files), folder=other)
    settings, notices, _ = _settings_of(task)
    collector = TrackCollector() if task.statistics else None
    analysis = analyse(
        task.path,
        settings,
        image_topic=task.image_topic,
        progress=_noting(task.note),
        scratch=task.folder.parent,
        observer=collector,
    )
    analysis.notices += notices
    if file_states(task.path) != files:
        raise RecordingError(
            str(task.path), 'changed while it was analysed', 'analyse it again when it is complete'
        )
    summary: Any = {
        'format': FORMAT,
        'bag': str(task.path),
        'content': content,
        'film': analysis.metadata.get('source_sha256', ''),
        'question': task.question,
        'experiment': metadata_of_settings(settings),
        **summary_of(analysis, task.path),
    }

    def more(folder: Path) -> None:
        for number, tray in summary['trays'].items():
            tray['by_cycle'] = cycles_by_measure(folder, int(number))
        write_archive(folder / EVIDENCE, evidence_arrays(analysis))
        if collector is not None:
            last = {number: tray.cors[-1] for number, tray in analysis.trays.items() if tray.cors}
            trays = load_trays(settings.trays_file or None)
            write_statistics(folder, collector, trays, settings, last)
        write_bytes(folder / SUMMARY, json.dumps(summary, allow_nan=False).encode())

    write_results(analysis, task.folder, task.path, settings, more=more)
    return replace(_outcome(summary, files), frames=analysis.frames)


def _settings_of(task: BagTask) -> RecordedSettings:
    if task.told is None:
        return RecordedSettings(task.settings, ())
    metadata = read_metadata(task.path)
    return recorded_settings(task.settings, task.told, metadata, str(task.path))


def _outcome(summary: BagSummary, files: tuple[FileState, ...]) -> BagOutcome:
    return BagOutcome(
        state=summary['state'],
        reason=summary['reason'],
        content=summary['content'],
        files=files,
    )


def _noting(note: Path) -> Any:
    last = 0.0

    def progress(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _NOTE:
            last = now
            # Progress is not essential.
            with suppress(OSError):
                note.write_text(f'{done} {total}', 'ascii')

    return progress
