"""The report of a batch: one HTML page with embedded figures.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.outputs.html_report import (
    NOT_KNOWN,
    Picture,
    Section,
    Table,
    made_line,
    number,
    write_report,
)
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.records import AGREEMENT_TENSION
from nanorocks_ros.settings import PipelineSettings, priors_in_words, rows
from nanorocks_ros.studies.batch.batch_analysis import merged_notes
from nanorocks_ros.studies.batch.batch_figure import decays_figure
from nanorocks_ros.studies.batch.batch_statistics import statistics_section
from nanorocks_ros.studies.batch.batch_words import (
    conclusions,
    interval_cell,
    known_trays,
    mean_cell,
    measured_cell,
)
from nanorocks_ros.studies.batch.means_json import means_as_json
from nanorocks_ros.studies.batch.mixed_recordings import mixed_recordings
from nanorocks_ros.studies.figures.long_term_figure import long_term_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.settings import PriorSettings
    from nanorocks_ros.studies.batch.batch_analysis import BagResults, Batch
    from nanorocks_ros.studies.batch.campaign_means import Combined, CycleRow, TrayMeans

_MM = 1e3
# Place of a section after restitutions, clusters and figures.
_AFTER_FIGURES = 3
_SHORTEST_DAY = 86_400 * 365


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
                _restitutions(together, settings.prior),
                _clusters(together),
                _figures(Path(scratch), batch, together),
                *_cycles(together),
                _recordings(batch, settings),
            ]
            gas = statistics_section({result.name: result.folder for result in batch.counted})
            if gas is not None:
                sections.insert(_AFTER_FIGURES, gas)
            if batch.failed:
                sections.insert(0, _failures(batch))
            conclusion = ' '.join([*conclusions(together), *mixed])
            write_report(path, 'NanoRocks, all recordings', conclusion, sections, made)
    except OSError as error:
        raise RecordingError(
            str(path), f'cannot be written ({error.strerror})', 'make room for its pictures'
        ) from error


def _failures(batch: Batch) -> Section:
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


def _restitutions(together: Combined, prior: PriorSettings) -> Section:
    return Section(
        title='Restitution of all cycles together',
        parts=[
            Table(
                head=('tray', 'cycles', 'decays left out', 'source', 'beads', 'walls', 'rebounds',
                      'collisions', 'tension'),
                rows=[_together(tray) for tray in known_trays(together)],
                caption='What decays, rebounds and collisions of all cycles say together. What is '
                'not known of tray, camera and start is the same in all of them: it is part of '
                'the interval, and does not become less with more cycles. A dash: hardly known. '
                'Source: joint, decays and contacts together; contacts, where decays disagree '
                f'with them (a tension beyond {AGREEMENT_TENSION:g}) or walls rub: then something '
                'happens that is not '
                'simulated. Decays of such cycles are left out, unless '
                'cooling.include_inconsistent is set; their contacts count.',
            ),
            Table(
                head=('tray', 'COR of a cycle', "by the paper's closed form", 'v0 [mm/s]',
                      'peak [mm/s]', 'tau [s]'),
                rows=[
                    (str(tray.tray), *(mean_cell(tray, name, factor) for name, factor in (
                        ('cycle_restitution', 1.0), ('paper_restitution', 1.0),
                        ('initial_speed', _MM), ('peak_speed', _MM), ('haff_time', 1.0))))
                    for tray in known_trays(together)
                ],
                caption='Means over the cycles ± scatter of a single cycle, as the paper reports '
                'them over its 178 runs; in brackets how many cycles are known. v0 and tau count '
                'where the fit knows them to half of their value.',
            ),
            f'Assumed before anything is measured (priors): {priors_in_words(prior)}.',
            *(_unread(together)),
        ],
    )  # fmt: skip


def _unread(together: Combined) -> list[str]:
    return [f'{notice}.' for notice in together.notices]


def _together(tray: TrayMeans) -> tuple[str, ...]:
    values = means_as_json(tray)
    return (
        str(tray.tray),
        str(values['cycles_read']),
        str(values['decays_left_out']),
        values['headline'] or NOT_KNOWN,
        interval_cell(values, 'restitution'),
        interval_cell(values, 'wall_restitution'),
        str(values['rebounds']),
        str(values['collisions']),
        number(values['tension'], 2),
    )


def _clusters(together: Combined) -> Section:
    in_mm = together.size_unit == 'm'
    size = 'correlation length [mm]' if in_mm else 'cluster size [beads]'
    rows = []
    for tray in known_trays(together):
        values = means_as_json(tray)
        status = (values['sticking_status'] or 'not looked for').replace('_', ' ')
        merges = values['merges']
        rows.append(
            (
                str(tray.tray),
                interval_cell(values, 'sticking_speed', _MM),
                status,
                NOT_KNOWN if merges is None else str(merges),
                mean_cell(tray, 'cluster_size', _MM if in_mm else 1.0),
                mean_cell(tray, 'bodies'),
                mean_cell(tray, 'onset'),
            )
        )
    return Section(
        title='Sticking and clusters',
        parts=[
            Table(
                head=('tray', 'sticking speed [mm/s]', 'status', 'merges', size, 'bodies',
                      'onset [s]'),
                rows=rows,
                caption='Sticking speed by the merges of all cycles together, with its interval; '
                'the others at the end of the cycle, mean ± scatter of a cycle (cycles known).',
            )
        ],
    )  # fmt: skip


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


def _cycles(together: Combined) -> list[Section]:
    sections = []
    size, factor = ('length [mm]', _MM) if together.size_unit == 'm' else ('size [beads]', 1.0)
    for tray in known_trays(together):
        own = [row for row in together.cycles if row.tray == tray.tray]
        table = Table(
            head=('recording', 'cycle', 'start [s]', 'COR', 'walls', "paper's form", 'v0 [mm/s]',
                  'tau [s]', 'peak [mm/s]', size, 'sticking [mm/s]', 'status'),
            rows=[_cycle(row, factor) for row in own],
        )  # fmt: skip
        sections.append(Section(title=f'Cycles of tray {tray.tray}', parts=[table]))
    return sections


def _cycle(row: CycleRow, factor: float) -> tuple[str, ...]:
    values = row.values
    return (
        Path(row.recording).name,
        str(values['cycle']),
        number(values['start'], 4),
        interval_cell(values, 'restitution'),
        interval_cell(values, 'wall_restitution'),
        number(values['paper_restitution'], 3),
        measured_cell(values, 'initial_speed', _MM),
        measured_cell(values, 'haff_time'),
        measured_cell(values, 'peak_speed', _MM),
        measured_cell(values, 'cluster_size', factor),
        interval_cell(values, 'sticking_speed', _MM),
        values['status'].replace('_', ' '),
    )


def _recordings(batch: Batch, settings: PipelineSettings) -> Section:
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
