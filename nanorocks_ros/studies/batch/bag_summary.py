"""What a batch keeps of a recording: its summary as JSON, and the arrays behind its restitutions.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any, TypedDict, cast

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
from nanorocks_ros.outputs.json_values import json_values, read_object
from nanorocks_ros.outputs.named_recordings import with_recording
from nanorocks_ros.outputs.safe_text import printable
from nanorocks_ros.studies.analysis.cycle_summaries import SIZE_MEASURES, CycleSummary, cycles_of
from nanorocks_ros.studies.analysis.results.results_folder import SUMMARY
from nanorocks_ros.studies.analysis.results.results_json import as_json

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.outputs.npz_archive import Arrays
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis

DONE, PARTIAL, FAILED, UNWRITTEN = 'done', 'partial', 'failed', 'unwritten'
"""States of a recording; see `BagOutcome`."""
FORMAT = 2
"""Of the summary: 2 since flags are words."""

# Provenance kept of a recording: so many entries, each so long.
_MOST_ENTRIES, _LONGEST = 100, 500


class TraySummary(TypedDict):
    """One tray in a `BagSummary`; see `results_json` for the keys of a cycle."""

    cycles: list[dict[str, Any]]
    recognition: list[dict[str, Any]]
    truth: dict[str, Any] | None
    by_cycle: dict[str, list[dict[str, Any]]]


class BagSummary(TypedDict):
    """The JSON object `SUMMARY` in the results of a recording.

    Attributes
    ----------
    content, film : str
        Hashes of the recording, and of the film that it was imported from or ''.
    question : str
        Hash of the settings.
    state, reason : str
        As in `BagOutcome`.
    start_ns : int, [ns]
        Stamp of the first frame.
    experiment : dict of str to str
        Trays, beads and scale by which it was analysed, as a recording keeps them.
    trays : dict of str to TraySummary
        By number.
    """

    format: int
    bag: str
    content: str
    film: str
    question: str
    frames: int
    frames_lost: int
    seconds: float
    complete: bool
    notices: list[str]
    state: str
    reason: str
    start_ns: int
    metadata: dict[str, str]
    experiment: dict[str, str]
    trays: dict[str, TraySummary]


def read_summary(folder: Path) -> BagSummary | None:
    """The summary in a folder of results; None where there is none that can be read."""
    try:
        summary = read_object(folder / SUMMARY)
    except (OSError, ValueError, RecordingError):
        return None
    if summary.get('format') == FORMAT and set(BagSummary.__annotations__) <= set(summary):
        return cast('BagSummary', summary)
    return None


def summary_of(analysis: Analysis, recording: Path) -> dict[str, Any]:
    """The entries of a `BagSummary` that follow from the analysis alone."""
    error = analysis.error
    return {
        **with_recording(as_json(analysis, series=False), recording),
        'notices': [printable(notice) for notice in analysis.notices],
        'state': DONE if error is None else PARTIAL,
        'reason': '' if error is None else printable(str(error)),
        'start_ns': min(analysis.stamps_ns),
        'metadata': {
            printable(key)[:_LONGEST]: printable(value)[:_LONGEST]
            for key, value in list(analysis.metadata.items())[:_MOST_ENTRIES]
        },
    }


def cycles_by_measure(folder: Path, tray: int) -> dict[str, list[dict[str, Any]]]:
    """Cycles by each measure of cluster size that was known in the recording."""
    if not (folder / f'tray_{tray}_speed.csv').is_file():
        return {}
    by_measure = {}
    for measure in SIZE_MEASURES:
        cycles = cycles_of(folder, tray, measure)
        if measure is SIZE_MEASURES[-1] or _any_size(cycles):
            by_measure[measure.column] = [json_values(asdict(cycle)) for cycle in cycles]
    return by_measure


def _any_size(cycles: list[CycleSummary]) -> bool:
    return any(np.isfinite(cycle.cluster_size) for cycle in cycles)


def evidence_arrays(analysis: Analysis) -> Arrays:
    """What the restitutions and sticking speeds of several recordings are combined from."""
    arrays: Arrays = {}
    for number, results in analysis.trays.items():
        if results.evidence is not None:
            for name, values in results.evidence.arrays().items():
                arrays[f'{number}/cor/{name}'] = values
        for k, cycle in enumerate(results.sticking):
            for name in (own.name for own in fields(StickingCycle)):
                arrays[f'{number}/sticking/{k:05d}/{name}'] = np.asarray(getattr(cycle, name))
    return arrays
