"""The tables of a batch report: restitutions, sticking and clusters of each tray, and every cycle.

Tested by ``test/studies/batch/test_batch_analysis.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nanorocks_ros.outputs.html_report import NOT_KNOWN, Section, Table, number
from nanorocks_ros.records import AGREEMENT_TENSION
from nanorocks_ros.settings import priors_in_words
from nanorocks_ros.studies.batch.means_json import means_as_json
from nanorocks_ros.studies.batch.report.batch_words import (
    interval_cell,
    known_trays,
    mean_cell,
    measured_cell,
)

if TYPE_CHECKING:
    from nanorocks_ros.settings import PriorSettings
    from nanorocks_ros.studies.batch.campaign_means import Combined, CycleRow, TrayMeans

_MM = 1e3


def restitutions_section(together: Combined, prior: PriorSettings) -> Section:
    """Restitutions by all cycles together, means over the cycles, and what was assumed."""
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


def clusters_section(together: Combined) -> Section:
    """Sticking speeds and cluster sizes of each tray."""
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


def cycle_sections(together: Combined) -> list[Section]:
    """A table of all cycles for each tray."""
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
