"""The page of a measured film.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.outputs.html_report import (
    Picture,
    Section,
    Table,
    made_line,
    number,
    write_report,
)
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.pipeline.contact_words import restitution_text, restitutions
from nanorocks_ros.studies.analysis.results.published_cycles import (
    published_cycles,
    published_text,
)
from nanorocks_ros.studies.measure.measure_figure import measure_figure
from nanorocks_ros.studies.measure.measure_tables import (
    CONTACTS,
    MEAN_SPEEDS,
    RESTITUTIONS,
    tray_tables,
)
from nanorocks_ros.studies.measure.measured_tray import DECAY_PREFIX

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.measure.measured_tray import MeasuredTray


def write_measure_report(
    path: Path,
    film: str,
    tracked: TrackedBag,
    trays: tuple[MeasuredTray, ...],
    picture: Path,
) -> None:
    """Write the page, and its figures beside it.

    Parameters
    ----------
    path : Path
    film : str
        Name of the film.
    tracked : TrackedBag
    trays : tuple of MeasuredTray
    picture : Path
        Of the tracks.

    Raises
    ------
    RecordingError
        When it cannot be written.
    """
    sections = [
        Section(
            title='Are the beads recognised?',
            parts=[
                *(line for tray in trays for line in tray.recognition),
                Picture(
                    path=picture,
                    caption='The last frame: beads in rings, with their last paths',
                    has_text=False,
                ),
            ],
        ),
        *(
            section
            for tray in trays
            for section in (_tray_section(path.parent, tray, tracked), _decay_section(tray))
        ),
        Section(title='What was said on the way', parts=list(tracked.notices)),
    ]
    made = f'{made_line()} {counted(tracked.frames, "frame")}.'
    conclusion = _conclusion(path.parent, trays, usable=tracked.usable)
    write_report(path, f'Measured: {film}', conclusion, sections, made)


def _conclusion(folder: Path, trays: tuple[MeasuredTray, ...], *, usable: bool) -> str:
    """Whether the film can be used, and the restitutions of each tray, the published first."""
    lines = [] if usable else ['NOT USABLE: see the first section.']
    for tray in trays:
        published = _published(folder, tray)
        if published:
            lines.append(f'Tray {tray.number}: {published}.')
        alone = tray.contacts.alone
        beads, walls = (restitution_text(kind, tray.unit) for kind in (alone.beads, alone.walls))
        where = 'By contacts alone' if published else f'Tray {tray.number}, by contacts alone'
        lines.append(f'{where}: two beads {beads}; walls {walls}.')
    return ' '.join([*lines, 'Brackets are intervals of 95 %.'])


def _published(folder: Path, tray: MeasuredTray) -> str:
    """The restitutions by decay and contacts; '' where the decay was not read."""
    if not tray.decay_read:
        return ''
    name = f'tray_{tray.number}'
    cors = published_cycles(folder / name / f'{name}_speed.csv', tray.number)
    return published_text(cors) if cors else ''


def _tray_section(folder: Path, tray: MeasuredTray, tracked: TrackedBag) -> Section:
    figure = folder / f'tray_{tray.number}_measured.png'
    tables = tray_tables(tray, tracked)
    measure_figure(
        figure, *(tables[name].values for name in (MEAN_SPEEDS, CONTACTS, RESTITUTIONS))
    )
    return Section(
        title=f'Tray {tray.number}: motion and contacts',
        parts=[
            *tray.lines,
            Picture(path=figure, caption='Speeds of the beads, and contacts'),
            _table(tray),
        ],
    )


def _decay_section(tray: MeasuredTray) -> Section:
    lines = [line.removeprefix(DECAY_PREFIX) for line in tray.decay]
    return Section(title=f'Tray {tray.number}: decay of the speeds', parts=list(lines))


def _table(tray: MeasuredTray) -> Table:
    unit = tray.unit
    rows = [
        (
            name,
            str(value.contacts),
            restitution_text(value, unit).partition(' (')[0],
            number(value.speed, 3, unit.per_metre),
        )
        for name, value in restitutions(tray.contacts).items()
    ]
    return Table(
        head=('of', 'contacts', 'restitution', f'median normal speed before [{unit.name}/s]'),
        rows=rows,
        caption='By contacts alone: mean and interval of 95 %.',
    )
