"""The page of a measured film.

Tested by ``test/studies/measure/test_measure_film.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nanorocks_ros.outputs.html_report import (
    Picture,
    Section,
    Table,
    made_line,
    number,
    write_report,
)
from nanorocks_ros.outputs.json_values import json_values
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.studies.measure.measure_figure import measure_figure
from nanorocks_ros.studies.measure.measured_words import restitution_text, wall_name

if TYPE_CHECKING:
    from pathlib import Path

    from nanorocks_ros.inference.contacts.contacts_alone import RestitutionOfContacts
    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.measure.measured_words import LengthUnit
    from nanorocks_ros.studies.measure.track_contacts import TrackContacts
    from nanorocks_ros.studies.measure.track_speeds import TrackSpeeds

DECAY_NOT_READ = 'decay: not read'
"""How the line begins that says why the decay is not read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredTray:
    """What was measured of one tray.

    Parameters
    ----------
    number : int
    unit : LengthUnit
    speeds : TrackSpeeds
    contacts : TrackContacts
    recognition, lines, decay : tuple of str
        Verdicts on the beads, motion and contacts, and the decay, in words.
    """

    number: int
    unit: LengthUnit
    speeds: TrackSpeeds
    contacts: TrackContacts
    recognition: tuple[str, ...]
    lines: tuple[str, ...]
    decay: tuple[str, ...]

    @property
    def decay_read(self) -> bool:
        """Whether there are results of the decay, in the folder of the tray."""
        return bool(self.decay) and not self.decay[0].startswith(DECAY_NOT_READ)

    def as_json(self) -> dict[str, Any]:
        """Numbers in s and m, or px where no length is known; None where unknown; all lines."""
        contacts, first_last = self.contacts, self.speeds.ends
        scale = 1.0 if self.unit.name != 'px' else self.unit.per_metre
        acceleration = contacts.acceleration
        values = {
            'length_unit': 'm' if self.unit.name != 'px' else 'px',
            'collisions': len(contacts.collisions),
            'rebounds': len(contacts.rebounds),
            'beads': _plain(contacts.alone.beads, scale),
            'walls': _plain(contacts.alone.walls, scale),
            'by_wall': {
                wall_name(contacts, wall): _plain(value, scale)
                for wall, value in contacts.alone.by_wall.items()
            },
            'acceleration': [scale * part for part in acceleration.value],
            'acceleration_error': scale * acceleration.error,
            'accelerated': acceleration.is_seen,
            'first_mean_speed': scale * first_last[0],
            'last_mean_speed': scale * first_last[1],
            'recognition': self.recognition,
            'lines': self.lines,
            'decay': self.decay,
        }
        plain: dict[str, Any] = json_values(values)
        return plain


def _plain(value: RestitutionOfContacts, scale: float) -> dict[str, Any]:
    interval = value.restitution
    return {
        'contacts': value.contacts,
        'restitution': interval.value,
        'restitution_error': interval.error,
        'restitution_lower': interval.lower,
        'restitution_upper': interval.upper,
        'restitution_lower_68': value.lower_68,
        'restitution_upper_68': value.upper_68,
        'speed': scale * value.speed,
    }


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
                    path=picture, caption='The last frame: beads in rings, with their last paths'
                ),
            ],
        ),
        *(_tray_section(path.parent, tray) for tray in trays),
        Section(title='What was said on the way', parts=list(tracked.notices)),
    ]
    made = f'{made_line()} {counted(tracked.frames, "frame")}.'
    conclusion = _conclusion(trays, usable=tracked.usable)
    write_report(path, f'Measured: {film}', conclusion, sections, made)


def _conclusion(trays: tuple[MeasuredTray, ...], *, usable: bool) -> str:
    """Whether the film can be used, and the restitutions of each tray."""
    lines = [] if usable else ['NOT USABLE: see the first section.']
    for tray in trays:
        alone = tray.contacts.alone
        beads, walls = (restitution_text(kind, tray.unit) for kind in (alone.beads, alone.walls))
        lines.append(f'Tray {tray.number}: restitution of two beads {beads}; of walls {walls}.')
    return ' '.join([*lines, 'By contacts alone, with intervals of 95 %.'])


def _tray_section(folder: Path, tray: MeasuredTray) -> Section:
    figure = folder / f'tray_{tray.number}_measured.png'
    measure_figure(figure, tray.speeds, tray.contacts, tray.unit)
    return Section(
        title=f'Tray {tray.number}',
        parts=[
            *tray.lines,
            Picture(path=figure, caption='Speeds of the beads, and contacts'),
            _table(tray),
            *tray.decay,
        ],
    )


def _table(tray: MeasuredTray) -> Table:
    alone, unit = tray.contacts.alone, tray.unit
    kinds = {'beads': alone.beads, 'walls': alone.walls}
    kinds |= {wall_name(tray.contacts, wall): value for wall, value in alone.by_wall.items()}
    rows = [
        (
            name,
            str(value.contacts),
            restitution_text(value, unit).partition(' (')[0],
            number(value.speed, 3, unit.per_metre),
        )
        for name, value in kinds.items()
    ]
    return Table(
        head=('of', 'contacts', 'restitution', f'median normal speed before [{unit.name}/s]'),
        rows=rows,
        caption='By contacts alone: mean and interval of 95 %.',
    )
