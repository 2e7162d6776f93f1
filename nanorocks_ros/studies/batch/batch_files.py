"""Tables and report of a batch, beside the results of each recording.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.experiment.trays import trays_text
from nanorocks_ros.settings import rows
from nanorocks_ros.studies.batch.batch_tables import write_tables
from nanorocks_ros.studies.batch.report.batch_report import write_batch_report
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.batch.batch_analysis import Batch
    from nanorocks_ros.studies.batch.campaign_means import Combined

REPORT = 'report.html'


def write_batch(
    folder: Path, batch: Batch, together: Combined, settings: PipelineSettings, kind: str
) -> Path:
    """Write tables and report.

    Parameters
    ----------
    folder : Path
    batch : Batch
    together : Combined
    settings : PipelineSettings
    kind : 'csv' or 'parquet'
        Of the tables.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    RecordingError
        When something cannot be written.
    """
    provenance = {
        **run_provenance(),
        'settings': {
            **{row.name: row.default for row in rows(settings)},
            'trays_file': trays_text(settings.trays_file) if settings.trays_file else '',
        },
    }
    write_tables(together, folder, kind, provenance)
    path = folder / REPORT
    write_batch_report(path, batch, together, settings)
    return path
