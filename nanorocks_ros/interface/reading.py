"""Read results of the commands: `nanorocks_ros.read`.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.interface.analysis_result import AnalysedRecording, AnalysisResult
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK
from nanorocks_ros.recordings.film.natural_sort import natural_key
from nanorocks_ros.studies.analysis.results_reader import read_analysis

if TYPE_CHECKING:
    from nanorocks_ros.interface.inputs import PathLike


def read(folder: PathLike) -> AnalysisResult:
    """Read results that ``nanorocks analyse``, `AnalysisResult.save` or `measure` wrote.

    Parameters
    ----------
    folder : path
        Of one recording, of a batch, or any folder with such folders in it. Of a folder of
        `measure` it is what the decay of the speeds gave.

    Returns
    -------
    AnalysisResult
        As of `analyse`; ``.combined`` needs what only a batch keeps.

    Raises
    ------
    RecordingError
        When there are no results, or they cannot be read.
    """
    with in_python():
        top = Path(folder).expanduser()
        if not top.is_dir():
            raise RecordingError(str(folder), 'is no folder', 'name a folder of results')
        marks = sorted(top.rglob(RESULTS_MARK), key=lambda mark: natural_key(str(mark)))
        if not marks:
            raise RecordingError(
                str(folder),
                'holds no results',
                'name the folder that `nanorocks analyse` or save() wrote',
            )
        recordings = []
        for mark in marks:
            source, analysis, settings = read_analysis(mark.parent)
            recordings.append(
                AnalysedRecording(
                    name=source, source=mark.parent, settings=settings, analysis=analysis
                )
            )
        return AnalysisResult(recordings, ())
