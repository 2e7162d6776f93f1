"""Tasks whose results are kept in a journal, so that an interrupted call goes on."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, TypeVar

from nanorocks_ros.jobs.tasks import as_finished

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from nanorocks_ros.jobs.journal import Journal
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.outputs.npz_archive import Arrays

Argument = TypeVar('Argument')


def fill_journal(
    journal: Journal,
    function: Callable[[Argument], Arrays],
    tasks: Mapping[str, Argument],
    workers: Workers,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Do the tasks whose results are not in the journal, and keep each as it comes.

    Parameters
    ----------
    journal : Journal
    function, tasks, workers
        As for `as_finished`; keys are those of the journal.
    progress : callable, optional
        Called with the tasks done and the tasks there are, those that were there among them.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C; its text says what is kept.
    """
    report = progress or (lambda done, total: None)
    there = set(journal.good_keys())
    missing = {key: task for key, task in tasks.items() if key not in there}
    done = len(tasks) - len(missing)
    report(done, len(tasks))
    try:
        with closing(as_finished(function, missing, workers)) as results:
            for key, found in results:
                journal.write(key, found)
                done += 1
                report(done, len(tasks))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f'{len(journal.keys())} of {len(tasks)} parts are kept in {journal.folder}; the same '
            'command goes on from there'
        ) from None
