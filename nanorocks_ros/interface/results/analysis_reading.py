"""Results of analyses, read from their folders.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.interface.results.analysis_result import AnalysedRecording, AnalysisResult
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK
from nanorocks_ros.recordings.film.natural_sort import natural_key
from nanorocks_ros.studies.analysis.results.results_reader import read_analysis

if TYPE_CHECKING:
    from pathlib import Path


def analysis_of(folder: Path) -> AnalysisResult:
    """All analyses in a folder, and in the folders in it.

    Raises
    ------
    RecordingError
        When there are none, or they cannot be read.
    """
    marks = sorted(folder.rglob(RESULTS_MARK), key=lambda mark: natural_key(str(mark)))
    if not marks:
        raise RecordingError(
            str(folder),
            'holds no results',
            'name a folder or a table that a command, or save(), wrote',
        )
    recordings = []
    for mark in marks:
        own = read_analysis(mark.parent)
        recordings.append(
            AnalysedRecording(
                name=own.source,
                source=mark.parent,
                path=own.source,
                settings=own.settings,
                analysis=own.analysis,
                run=own.run,
            )
        )
    return AnalysisResult(recordings, ())
