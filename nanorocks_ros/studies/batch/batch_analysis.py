"""Many recordings analysed, by many workers, so that no one of them matters to the others."""

from __future__ import annotations

from contextlib import closing, suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.jobs.tasks import as_completed_isolated
from nanorocks_ros.outputs.safe_text import printable
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.recordings.bag.fingerprint import file_states, total_size
from nanorocks_ros.recordings.film.natural_sort import natural_key
from nanorocks_ros.studies.batch.bag_summary import (
    DONE,
    FAILED,
    PARTIAL,
    UNWRITTEN,
    read_summary,
)
from nanorocks_ros.studies.batch.batch_store import BatchStore
from nanorocks_ros.studies.batch.batch_task import BagOutcome, analyse_bag
from nanorocks_ros.studies.batch.manifest_entries import Entry

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.recordings.bag.find_bags import FoundBags
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.batch.bag_summary import BagSummary
    from nanorocks_ros.studies.batch.batch_task import BagTask

# A note on more recordings than this becomes one line.
_MOST_ALIKE = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchPlan:
    """What to analyse, and how.

    Parameters
    ----------
    bags : FoundBags
    folder : Path
        For results.
    settings : PipelineSettings
    image_topic : str
    told : frozenset of str or None
        Names of the settings that hold for all recordings; what a recording says of its trays
        replaces the others. None: all of them hold.
    statistics : bool
        Whether to measure the statistics of the gas, too.
    """

    bags: FoundBags
    folder: Path
    settings: PipelineSettings
    image_topic: str = ''
    told: frozenset[str] | None = None
    statistics: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BagResults:
    """A recording that was analysed.

    Parameters
    ----------
    name : str
        For people.
    folder : Path
        Of its results.
    summary : dict
        What `nanorocks analyse --json` gives, without the series, and more.
    twin : str
        Name of the recording that holds the same, bit by bit or imported from the same film, and
        counts in its place.
    """

    name: str
    folder: Path
    summary: BagSummary
    twin: str = ''

    @property
    def notes(self) -> list[str]:
        """Notes on the recording, one line each."""
        same = [f'is the same as {self.twin}, and not counted'] if self.twin else []
        reason = [self.summary['reason']] if self.summary['reason'] else []
        return [*same, *reason, *self.summary['notices']]


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A recording, or an input, that could not be used, or not as a whole.

    Parameters
    ----------
    name, reason : str
    analysed : bool
        Whether there are results of a part of it.
    """

    name: str
    reason: str
    analysed: bool = False


@dataclass(slots=True, kw_only=True)
class Batch:
    """The results of all recordings.

    Parameters
    ----------
    results : list of BagResults
        In order of time, or of their names where they began at the same time.
    failed : list of Failure
    """

    results: list[BagResults] = field(default_factory=list)
    failed: list[Failure] = field(default_factory=list)

    @property
    def counted(self) -> list[BagResults]:
        """Each recording once."""
        return [result for result in self.results if not result.twin]


def merged_notes(results: Sequence[BagResults]) -> list[str]:
    """The notes on recordings; a note on many of them becomes one line."""
    by_note: dict[str, list[BagResults]] = {}
    for result in results:
        for text in result.notes:
            note = text.removeprefix(result.name).lstrip(':/ ')
            by_note.setdefault(note, []).append(result)
    lines = []
    for note, own in by_note.items():
        if len(own) > _MOST_ALIKE:
            lines.append(f'{len(own)} recordings, such as {own[0].name}: {note}')
        else:
            lines += [f'{result.name}: {note}' for result in own]
    return lines


class Watcher(Protocol):
    """Receives the progress of a batch."""

    def begin(self, store: BatchStore, sizes: dict[str, int], done: int) -> None:
        """Bytes to analyse per recording, by folder, and the number of finished recordings."""

    def finished(self, name: str, outcome: BagOutcome) -> None:
        """A recording is done, or failed."""

    def notice(self, text: str) -> None:
        """A notice for the user, one line."""


def run_batch(plan: BatchPlan, workers: Workers, watcher: Watcher) -> Batch:
    """Analyse all recordings that are not analysed yet.

    What is done is kept in the folder: after an interruption the same call goes on from there,
    and does again what has changed.

    Parameters
    ----------
    plan : BatchPlan
    workers : Workers
    watcher : Watcher

    Raises
    ------
    ConfigurationError
        When the settings cannot be used.
    RecordingError
        When the folder cannot be used, or written any more.
    NanorocksError
        When a cluster cannot be used.
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    # Checked once, before hours of work, unless each recording says which trays it shows.
    if plan.told is None or 'trays' in plan.told or 'trays_file' not in plan.told:
        Pipeline(plan.settings, 'settings')
    workers.check()
    with BatchStore(
        plan.folder, plan.settings, plan.image_topic, plan.told, statistics=plan.statistics
    ) as store:
        tasks = store.add(plan.bags.bags)
        for text in store.notices:
            watcher.notice(text)
        store.write()
        try:
            with interruption_says(lambda: _kept(store)):
                _run(store, tasks, workers, watcher)
        finally:
            # On a full disk the earlier error is the better message.
            with suppress(RecordingError):
                store.write()
        return _gathered(plan, store)


def _run(store: BatchStore, tasks: dict[str, BagTask], workers: Workers, watcher: Watcher) -> None:
    sizes = {name: _size(task.path) for name, task in tasks.items()}
    watcher.begin(store, sizes, len(store.entries) - len(tasks))
    # The largest first, so that all workers finish at about the same time.
    ordered = {name: tasks[name] for name in sorted(tasks, key=lambda name: -sizes[name])}

    def lost(name: str, reason: str) -> BagOutcome:
        return BagOutcome(state=FAILED, reason=f'{printable(tasks[name].path)}: {reason}')

    with closing(as_completed_isolated(analyse_bag, ordered, workers, lost)) as outcomes:
        for name, outcome in outcomes:
            store.finish(name, outcome)
            if outcome.state == UNWRITTEN:
                # The others would fail in the same way.
                raise RecordingError(
                    str(store.folder),
                    f'cannot be written any more ({outcome.reason})',
                    f'make room; {_kept(store)}',
                )
            store.write()
            watcher.finished(name, outcome)


def _size(path: Path) -> int:
    try:
        return total_size(file_states(path))
    except OSError:
        return 0


def _kept(store: BatchStore) -> str:
    done = sum(entry.outcome.state in (DONE, PARTIAL) for entry in store.entries.values())
    return (
        f'{done} of {len(store.entries)} recordings are done and kept in {store.folder}; the same '
        'command goes on from there'
    )


def _gathered(plan: BatchPlan, store: BatchStore) -> Batch:
    batch = Batch()
    for text, error in plan.bags.missing.items():
        batch.failed.append(Failure(name=printable(text), reason=printable(str(error))))
    entries = sorted(store.entries.values(), key=lambda entry: natural_key(str(entry.path)))
    analysed: list[tuple[Entry, BagSummary]] = []
    for entry in entries:
        outcome = entry.outcome
        has_results = outcome.state in (DONE, PARTIAL)
        summary = read_summary(store.place(entry)) if has_results else None
        if summary is not None:
            analysed.append((entry, summary))
        if outcome.state != DONE or summary is None:
            reason = outcome.reason or f'{store.place(entry)}: its results are gone; try again'
            batch.failed.append(
                Failure(name=printable(entry.path), reason=reason, analysed=summary is not None)
            )
    analysed.sort(key=lambda pair: pair[1]['start_ns'])
    first: dict[str, str] = {}
    for entry, summary in analysed:
        name = printable(entry.path)
        # A film that was imported twice counts once.
        twin = first.setdefault(summary.get('film') or summary['content'], name)
        batch.results.append(
            BagResults(
                name=name,
                folder=store.place(entry),
                summary=summary,
                twin='' if twin == name else twin,
            )
        )
    return batch
