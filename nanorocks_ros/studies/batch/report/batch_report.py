"""The report of a batch: one HTML page with embedded figures.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.html_report import (
    Picture,
    Section,
    made_line,
    write_report,
)
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.batch.batch_statistics import statistics_section
from nanorocks_ros.studies.batch.mixed_recordings import mixed_recordings
from nanorocks_ros.studies.batch.report.batch_figure import decays_figure
from nanorocks_ros.studies.batch.report.batch_words import (
    conclusions,
    known_trays,
)
from nanorocks_ros.studies.batch.report.recording_tables import (
    failures_section,
    recordings_section,
)
from nanorocks_ros.studies.batch.report.tray_tables import (
    clusters_section,
    cycle_sections,
    restitutions_section,
)
from nanorocks_ros.studies.figures.long_term_figure import long_term_figure

if TYPE_CHECKING:
    from nanorocks_ros.studies.batch.batch_analysis import Batch
    from nanorocks_ros.studies.batch.campaign_means import Combined

# Place of a section after restitutions, clusters and figures.
_AFTER_FIGURES = 3


def write_batch_report(
    path: Path, batch: Batch, together: Combined, settings: PipelineSettings
) -> None:
    """Write the report: recordings, means over all cycles, every cycle, failures.

    Parameters
    ----------
    path : Path
    batch : Batch
    together : Combined
    settings : PipelineSettings

    Raises
    ------
    RecordingError
        When it cannot be written.
    """
    frames = sum(result.summary['frames'] for result in batch.results)
    seconds = sum(result.summary['seconds'] for result in batch.results)
    cycles = len(together.cycles)
    failed = f'; {len(batch.failed)} failed' if batch.failed else ''
    made = (
        f'{made_line()} {counted(len(batch.results), "recording")}, '
        f'{counted(frames, "frame")}, {seconds:.0f} s{failed}. '
        f'{counted(cycles, "cooling cycle")} of '
        f'{counted(sum(tray.cycles > 0 for tray in together.trays.values()), "tray")}.'
    )
    mixed = mixed_recordings(batch.counted)
    try:
        with TemporaryDirectory() as scratch:
            sections = [
                restitutions_section(together, settings.prior),
                clusters_section(together),
                _figures(Path(scratch), batch, together),
                *cycle_sections(together),
                recordings_section(batch, settings),
            ]
            gas = statistics_section({result.name: result.folder for result in batch.counted})
            if gas is not None:
                sections.insert(_AFTER_FIGURES, gas)
            if batch.failed:
                sections.insert(0, failures_section(batch))
            conclusion = ' '.join([*conclusions(together), *mixed])
            write_report(path, 'NanoRocks, all recordings', conclusion, sections, made)
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be written ({error.strerror})', 'make room for its pictures'
        ) from error


def _figures(scratch: Path, batch: Batch, together: Combined) -> Section:
    section = Section(title='Figures')
    folders = [result.folder for result in batch.counted]
    decays, long_term = scratch / 'decays.png', scratch / 'long_term.png'
    if decays_figure(decays, folders, known_trays(together)):
        section.parts.append(
            Picture(
                path=decays,
                caption='Mean projected speed as the gas cools: single cycles, their median, and '
                "Haff's law with the means over the cycles.",
            )
        )
    if together.campaign is not None:
        long_term_figure(long_term, together.campaign)
        section.parts.append(
            Picture(
                path=long_term,
                caption='Cycle by cycle, with trends: cluster sizes, peak speeds, restitutions '
                '(figure 9 of the paper).',
            )
        )
    if not section.parts:
        section.parts.append('There is no cycle after a shaking event to draw.')
    return section
