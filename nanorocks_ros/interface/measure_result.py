"""The result of `measure`: what a film of any beads says.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pandas as pd

from nanorocks_ros.interface.contact_frames import contact_frame
from nanorocks_ros.interface.python_words import python_words
from nanorocks_ros.interface.record_frames import in_px, joined, table_frame, with_column
from nanorocks_ros.interface.result import Result, Summary
from nanorocks_ros.outputs.html_report import with_interval
from nanorocks_ros.studies.analysis.tracks_files import columns_of, track_pieces
from nanorocks_ros.studies.measure.measured_words import wall_name

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from nanorocks_ros.inference.contacts.contacts_alone import RestitutionOfContacts
    from nanorocks_ros.interface.analysis_result import AnalysisResult
    from nanorocks_ros.studies.measure.measure_film import Measured, MeasurePlan
    from nanorocks_ros.studies.measure.measure_report import MeasuredTray

# What a line says of a restitution that is not known.
_UNKNOWN = re.compile('no restitution|not determined')
_SPEED_UNITS = {'time': 's', 'mean_speed': 'm/s', 'rms_speed': 'm/s', 'beads': '1'}


class MeasureResult(Result):
    """Tracks, speeds, contacts and restitutions of a film. `nanorocks_ros.measure` makes it.

    Where no length is told, lengths are in px of the film: the columns are called ``X_px``.

    Attributes
    ----------
    folder : Path
        Of tables, pictures and ``report.html``.
    """

    def __init__(self, measured: Measured, plan: MeasurePlan, notices: tuple[str, ...]) -> None:
        super().__init__(
            provenance={'film': plan.name},
            notices=(*notices, *measured.tracked.notices),
            usable=measured.usable,
        )
        self._measured = measured
        self._probability = plan.settings.cooling.probability
        self.folder: Path = plan.folder

    @property
    def speeds(self) -> pd.DataFrame:
        """Mean and rms projected speed of the beads over time."""
        return self.table('speeds')

    @property
    def tracks(self) -> pd.DataFrame:
        """Place and velocity of each bead in each frame."""
        return self.table('tracks')

    @property
    def contacts(self) -> pd.DataFrame:
        """Collisions of two beads and rebounds from walls, a row for each."""
        return self.table('contacts')

    @property
    def cor(self) -> pd.DataFrame:
        """Coefficients of restitution by contacts alone, with intervals of 68 and 95 %.

        A row for collisions of two beads, for all walls, and for each wall.
        """
        return self.table('cor')

    @property
    def decay(self) -> AnalysisResult | None:
        """Cycles, by the decay of the speeds and contacts together; None where not read."""
        if not any(tray.decay_read for tray in self._measured.trays):
            return None
        from nanorocks_ros.interface.reading import read

        return read(self.folder)

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        return {
            'speeds': lambda: self._joined(_speeds),
            'tracks': self._tracks,
            'contacts': lambda: self._joined(self._contacts),
            'cor': lambda: self._joined(_cor),
        }

    def _joined(self, make: Callable[[MeasuredTray], pd.DataFrame]) -> pd.DataFrame:
        frames = []
        for tray in self._measured.trays:
            frame = make(tray)
            if tray.unit.name == 'px':
                frame = in_px(frame, tray.unit.per_metre)
            frames.append(frame)
        return joined(frames, probability=self._probability)

    def _contacts(self, tray: MeasuredTray) -> pd.DataFrame:
        return contact_frame(tray.contacts.contacts, self._measured.tracked.epoch_ns)

    def _tracks(self) -> pd.DataFrame:
        tracked = self._measured.tracked
        return table_frame(columns_of(tracked), track_pieces(tracked))

    def _figure(self) -> Figure:
        from nanorocks_ros.studies.measure.measure_figure import measure_figure

        tray = self._measured.trays[0]
        return measure_figure(None, tray.speeds, tray.contacts, tray.unit)

    def _summary(self) -> Summary:
        rows, lines = [], []
        for tray in self._measured.trays:
            rows += [
                (f'{tray.number}', name, _interval(value), f'{value.contacts}')
                for name, value in _restitutions(tray).items()
            ]
            unknown = [line for line in tray.lines[2:] if _UNKNOWN.search(line)]
            lines += [*tray.recognition, *tray.lines[:2], *unknown, *tray.decay]
        verdict = '' if self.usable else ': NOT USABLE'
        return Summary(
            title=f'{self.provenance["film"]}{verdict}; report in {self.folder / "report.html"}',
            head=('tray', 'contacts of beads with', 'COR', 'contacts'),
            rows=tuple(rows),
            lines=(*map(python_words, lines), *self.notices),
        )


def _restitutions(tray: MeasuredTray) -> dict[str, RestitutionOfContacts]:
    alone, contacts = tray.contacts.alone, tray.contacts
    walls = {wall_name(contacts, wall): value for wall, value in alone.by_wall.items()}
    return {'beads': alone.beads, 'walls': alone.walls, **walls}


def _interval(value: RestitutionOfContacts) -> str:
    interval = value.restitution
    return with_interval(interval.value, (interval.lower, interval.upper))


def _speeds(tray: MeasuredTray) -> pd.DataFrame:
    frame = pd.DataFrame(dict(zip(_SPEED_UNITS, tray.speeds, strict=True)))
    frame.attrs['units'] = dict(_SPEED_UNITS)
    return with_column(frame, 0, 'tray', tray.number)


def _cor(tray: MeasuredTray) -> pd.DataFrame:
    rows: list[dict[str, Any]] = [
        {
            'tray': tray.number,
            'partner': name,
            'contacts': value.contacts,
            'restitution': value.restitution.value,
            'restitution_error': value.restitution.error,
            'restitution_lower': value.restitution.lower,
            'restitution_upper': value.restitution.upper,
            'restitution_lower_68': value.lower_68,
            'restitution_upper_68': value.upper_68,
            'speed': value.speed,
        }
        for name, value in _restitutions(tray).items()
    ]
    frame = pd.DataFrame(rows)
    frame.attrs['units'] = {name: 'm/s' if name == 'speed' else '1' for name in frame.columns}
    return frame
