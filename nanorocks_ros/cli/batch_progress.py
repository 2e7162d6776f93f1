"""How an analysis of many recordings gets on: a bar on a terminal, lines elsewhere.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import math
import sys
import time
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from nanorocks_ros.cli.notices import tell

if TYPE_CHECKING:
    from nanorocks_ros.studies.batch.batch_store import BatchStore
    from nanorocks_ros.studies.batch.batch_task import BagOutcome


# Interval of updates of the progress bar, [s].
_UPDATE_INTERVAL = 1.0


# Interval of the lines that replace the bar outside a terminal, [s].
_LINE_INTERVAL = 60.0


class BatchProgress:
    """Recordings, frame rate and time left: a bar on a terminal, lines elsewhere."""

    def __init__(self) -> None:
        self._over = Event()
        self._bar: Any = None
        self._watcher: Thread | None = None

    def __enter__(self) -> BatchProgress:
        return self

    def begin(self, store: BatchStore, sizes: dict[str, int], done: int) -> None:
        """Start the display; `sizes` are the bytes of each recording left to do."""
        from tqdm import tqdm

        self._store, self._left = store, {name: max(size, 1) for name, size in sizes.items()}
        self._bytes, self._frames, self._failed = sum(self._left.values()), 0, 0
        self._done, self._all = done, done + len(sizes)
        self._start = time.monotonic()
        if done:
            tell(f'{done} of {self._all} recordings are finished and unchanged')
        self._bar = tqdm(
            total=1.0,
            disable=None,
            leave=False,
            bar_format='{desc} |{bar}|',
        )
        self._watcher = Thread(target=self._watch, daemon=True)
        self._watcher.start()

    def finished(self, name: str, outcome: BagOutcome) -> None:
        """Count a recording that is finished or failed."""
        from tqdm import tqdm

        from nanorocks_ros.studies.batch.bag_summary import DONE

        self._left.pop(name, None)
        self._frames += outcome.frames
        self._done += 1
        if outcome.state != DONE:
            self._failed += 1
            with tqdm.external_write_mode(file=sys.stderr):
                tell(outcome.reason)

    def notice(self, text: str) -> None:
        """Print one message for the user."""
        tell(text)

    def _watch(self) -> None:
        last = time.monotonic()
        while not self._over.wait(_UPDATE_INTERVAL):
            part, text = self._status()
            self._bar.n = part
            self._bar.set_description_str(text)
            if self._bar.disable and time.monotonic() - last >= _LINE_INTERVAL:
                last = time.monotonic()
                tell(text)

    def _status(self) -> tuple[float, str]:
        frames, left = self._frames, dict(self._left)
        for name, (done, total) in self._store.under_way().items():
            if name in left:
                frames += done
                left[name] = round(left[name] * (1.0 - done / max(total, done, 1)))
        part = 1.0 - sum(left.values()) / max(self._bytes, 1)
        seconds = time.monotonic() - self._start
        left_s = seconds * (1.0 / part - 1.0) if part > 0.0 else math.inf
        when = f'{math.ceil(left_s / 60.0)} min left' if part > 0.0 else 'starting'
        failed = f', {self._failed} failed' if self._failed else ''
        counts = f'{self._done} of {self._all} recordings'
        return part, f'{counts}, {frames / seconds:.0f} frames/s, {when}{failed}'

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._watcher is not None:
            self._watcher.join()
        if self._bar is not None:
            self._bar.close()
