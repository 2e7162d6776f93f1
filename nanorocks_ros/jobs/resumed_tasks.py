"""Tasks whose results are kept in a journal, so that an interrupted job can be resumed."""

from __future__ import annotations

from contextlib import closing, contextmanager
from typing import TYPE_CHECKING, TypeVar

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.interruption import interruption_says
from nanorocks_ros.jobs.journal import Journal
from nanorocks_ros.jobs.tasks import as_completed
from nanorocks_ros.outputs.npz_archive import read_archive

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.npz_archive import Arrays

Argument = TypeVar('Argument')


def parts_folder(output: Path) -> Path:
    """Folder that keeps the finished parts of a job until its output is complete."""
    return output.with_name(f'{output.name}.parts')


def delete_parts_of_finished(output: Path, specification: str) -> bool:
    """Delete the parts that a kill left beside a complete output.

    Parameters
    ----------
    output : Path
        An archive; its array ``made_by`` is the specification of its job.
    specification : str
        See `Journal`.

    Returns
    -------
    bool
        Whether there were such parts. Those of another job stay, those of one that runs, and
        those that are newer than the output: a job that replaces it was interrupted.
    """
    folder = parts_folder(output)
    if not folder.is_dir() or not output.is_file():
        return False
    try:
        if str(read_archive(output).get('made_by', '')) != specification:
            return False
        with Journal(folder, specification) as journal:
            if journal.newest_ns() > output.stat().st_mtime_ns:
                return False
            journal.delete()
    except RecordingError:
        return False
    return not folder.exists()


@contextmanager
def resumed_journal(
    output: Path, specification: str, notice: Callable[[str], None] | None = None
) -> Iterator[Journal]:
    """Open the journal of an output; delete it when the block ends without an exception.

    Parameters
    ----------
    output : Path
        The journal lies in `parts_folder` of it.
    specification : str
        See `Journal`.
    notice : callable, optional
        Called with one line of text for each damaged part, which is deleted.

    Yields
    ------
    Journal
        Its parts can be read.

    Raises
    ------
    RecordingError
        When the folder cannot be used, or holds the parts of another job.
    """
    with Journal(parts_folder(output), specification) as journal:
        journal.intact_keys()
        if notice is not None:
            for text in journal.notices:
                notice(text)
        yield journal
        journal.delete()


def fill_journal(
    journal: Journal,
    function: Callable[[Argument], Arrays],
    tasks: Mapping[str, Argument],
    workers: Workers,
    progress: Progress | None = None,
) -> None:
    """Run the tasks whose results are not in the journal, and write each result to it.

    Parameters
    ----------
    journal : Journal
        Its parts can be read.
    function, tasks, workers
        As for `as_completed`; the keys are those of the journal.
    progress : callable, optional
        Called with the number of finished tasks, those of earlier calls included, and the number
        of tasks.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    report = progress or (lambda done, total: None)
    finished = set(journal.keys())
    missing = {key: task for key, task in tasks.items() if key not in finished}
    done = len(tasks) - len(missing)
    report(done, len(tasks))

    def kept() -> str:
        return (
            f'{len(journal.keys())} of {len(tasks)} parts are kept in {journal.folder}; the same '
            'command goes on from there'
        )

    with interruption_says(kept), closing(as_completed(function, missing, workers)) as results:
        for key, arrays in results:
            journal.write(key, arrays)
            done += 1
            report(done, len(tasks))
