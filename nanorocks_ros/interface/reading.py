"""Read what any command wrote: `nanorocks_ros.read`.

Tested by ``test/interface/test_reading.py``.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError, did_you_mean_file
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.interface.record_frames import table_frame
from nanorocks_ros.interface.results.analysis_reading import analysis_of
from nanorocks_ros.interface.results.measure_result import MeasureResult
from nanorocks_ros.interface.results.tables_result import TablesResult
from nanorocks_ros.interface.table_reading import TABLES, described_tables, read_frame, run_of
from nanorocks_ros.outputs.json_values import parse_object
from nanorocks_ros.recordings.bag.bag_folder import METADATA
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK
from nanorocks_ros.settings import SimulationSettings, rows
from nanorocks_ros.studies.measure.measured_folder import is_measured
from nanorocks_ros.studies.sweeps.sweep_result import Sweep

if TYPE_CHECKING:
    import pandas as pd

    from nanorocks_ros.interface.inputs import PathLike
    from nanorocks_ros.interface.results.analysis_result import AnalysisResult


_REMEDY = 'name what a command wrote'


def read(path: PathLike) -> AnalysisResult | MeasureResult | TablesResult:
    """Read results that a command, or a method ``save``, wrote.

    Parameters
    ----------
    path : path
        Folder of ``nanorocks analyse`` (of one recording or of a batch), ``reproduce`` or any
        folder with such folders in it; folder of ``nanorocks measure``; folder of ``nanorocks
        statistics``; a table, ``.csv`` or ``.parquet``, of any command; ``.npz`` of ``nanorocks
        sweep``.

    Returns
    -------
    AnalysisResult, MeasureResult or TablesResult
        As of `analyse`, as of `measure`, or the tables by name. Of an analysis ``.combined`` needs
        what only a batch keeps.

    Raises
    ------
    RecordingError
        When there are no results, or they cannot be read.
    """
    with in_python():
        own = Path(path).expanduser()
        if own.suffix == '.npz' and own.is_file():
            return _sweep(own)
        if own.suffix in TABLES and own.is_file():
            return _tables([own], own)
        if not own.exists():
            remedy = did_you_mean_file(own) or _REMEDY
            raise RecordingError(str(path), 'does not exist', remedy)
        if not own.is_dir():
            raise RecordingError(str(path), 'is no folder and no table', _REMEDY)
        if is_measured(own):
            return MeasureResult(own)
        if any(own.rglob(RESULTS_MARK)):
            return analysis_of(own)
        tables = described_tables(own)
        if tables:
            return _tables(tables, own)
        if (own / METADATA).is_file():
            raise RecordingError(
                str(path), 'is a recording, no result', 'measure it with nr.analyse or nr.measure'
            )
        return analysis_of(own)


def _tables(files: list[Path], source: Path) -> TablesResult:
    makers = {file.stem: partial(read_frame, file) for file in files}
    return TablesResult(makers, source, run_of(files[0]))


def _sweep(file: Path) -> TablesResult:
    """The curves at every point of a sweep."""
    sweep = Sweep.load(file)

    def curves() -> pd.DataFrame:
        columns = sweep.columns({row.name: row.unit for row in rows(SimulationSettings())})
        names = [column.name for column in columns]
        values = zip(*sweep.rows(), strict=True)
        arrays = {name: np.array(column) for name, column in zip(names, values, strict=True)}
        return table_frame(columns, [arrays])

    return TablesResult({'curves': curves}, file, {'versions': parse_object(sweep.specification)})
