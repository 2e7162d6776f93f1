"""What a batch analysed, as sections of its report: recordings, their origin, what failed.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from nanorocks_ros.outputs.html_report import Section, Table
from nanorocks_ros.settings import PipelineSettings, rows
from nanorocks_ros.studies.batch.batch_analysis import merged_notes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.studies.batch.batch_analysis import BagResults, Batch

_SHORTEST_DAY = 86_400 * 365


def failures_section(batch: Batch) -> Section:
    """Recordings that could not be used, and why."""
    return Section(
        title='What failed',
        parts=[
            Table(
                head=('recording', 'why', 'results'),
                rows=[
                    (
                        failure.name,
                        failure.reason,
                        'of a part of it' if failure.analysed else 'none',
                    )
                    for failure in batch.failed
                ],
            )
        ],
    )


def recordings_section(batch: Batch, settings: PipelineSettings) -> Section:
    """All recordings, their notes and provenance, and settings other than the defaults."""
    usual = {row.name: row.default for row in rows(PipelineSettings())}
    changed = [
        (row.name, str(row.default)) for row in rows(settings) if row.default != usual[row.name]
    ]
    metadata = _metadata(batch.results)
    section = Section(
        title='What was analysed',
        parts=[
            Table(
                head=('recording', 'began', 'frames', 'lost', 'seconds', 'cycles', 'complete'),
                rows=[_recording(result) for result in batch.results],
            )
        ],
    )
    for head, lines, caption in (
        (('notes',), [(note,) for note in merged_notes(batch.results)], ''),
        (('entry', 'value'), metadata, 'Provenance that they hold, and in how many it differs'),
        (('setting', 'value'), changed, 'Settings other than the defaults'),
    ):
        if lines:
            section.parts.append(Table(head=head, rows=lines, caption=caption))
    return section


def _recording(result: BagResults) -> tuple[str, ...]:
    summary = result.summary
    cycles = max((len(tray['cycles']) for tray in summary['trays'].values()), default=0)
    return (
        result.name,
        _date(summary['start_ns']),
        str(summary['frames']),
        str(summary['frames_lost']),
        f'{summary["seconds"]:.1f}',
        str(cycles),
        'yes' if summary['complete'] else 'no',
    )


def _date(stamp_ns: int) -> str:
    """Date in UTC; seconds for a clock that starts at 0."""
    seconds = stamp_ns / 1e9
    if seconds < _SHORTEST_DAY:
        return f'{seconds:.1f} s'
    return time.strftime('%Y-%m-%d %H:%M:%S', time.gmtime(seconds))


def _metadata(results: Sequence[BagResults]) -> list[tuple[str, str]]:
    """Metadata of all recordings: the most frequent value of each entry."""
    values: dict[str, list[str]] = {}
    for result in results:
        for key, value in result.summary['metadata'].items():
            values.setdefault(key, []).append(value)
    entries = []
    for key, recorded in values.items():
        usual = max(set(recorded), key=recorded.count)
        other_count = len(results) - recorded.count(usual)
        entries.append(
            (key, f'{usual} (other or none in {other_count})' if other_count else usual)
        )
    return entries
