"""The result of `measure`: what a film of any beads says, read from its folder.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from nanorocks_ros.interface.python_words import python_words
from nanorocks_ros.interface.record_frames import joined
from nanorocks_ros.interface.results.result import NamedTable, Result, Summary, run_words
from nanorocks_ros.interface.table_reading import read_frame
from nanorocks_ros.outputs.html_report import with_interval
from nanorocks_ros.studies.measure.measure_tables import CONTACTS, MEAN_SPEEDS, RESTITUTIONS
from nanorocks_ros.studies.measure.measured_folder import TRACKS, read_measured

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd
    from matplotlib.figure import Figure

    from nanorocks_ros.interface.results.analysis_result import AnalysisResult

# What a line says of a restitution that is not known.
_UNKNOWN = re.compile('no restitution|not determined')


class MeasureResult(Result):
    """Tracks, speeds, contacts and restitutions of a film.

    `nanorocks_ros.measure` makes it, and `nanorocks_ros.read` of a folder of `nanorocks measure`.
    Where no length is told, lengths are in px of the film: the columns are called ``X_px``.

    Attributes
    ----------
    folder : Path
        Of tables, pictures and ``report.html``.
    """

    speeds = NamedTable('Mean and rms projected speed of the beads over time.')
    tracks = NamedTable('Place and velocity of each bead in each frame.')
    contacts = NamedTable('Collisions of two beads and rebounds from walls, a row for each.')
    cor = NamedTable(
        """Coefficients of restitution by contacts alone, with intervals of 68 and 95 %.

        A row for collisions of two beads, for all walls, and for each wall.
        """
    )

    def __init__(self, folder: Path, notices: tuple[str, ...] = ()) -> None:
        measured = read_measured(folder)
        run = measured.provenance
        super().__init__(
            provenance={**run_words(run.run), 'film': measured.film},
            notices=(*notices, *measured.notices),
            usable=measured.usable,
        )
        self._measured = measured
        self.folder = folder

    @property
    def decay(self) -> AnalysisResult | None:
        """Cycles, by the decay of the speeds and contacts together; None where not read."""
        if not self._measured.decay_read:
            return None
        from nanorocks_ros.interface.results.analysis_reading import analysis_of

        return analysis_of(self.folder)

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        return {
            'speeds': lambda: self._joined(MEAN_SPEEDS),
            'tracks': lambda: read_frame(self.folder / TRACKS),
            'contacts': lambda: self._joined(CONTACTS),
            'cor': lambda: self._joined(RESTITUTIONS),
        }

    def _joined(self, name: str) -> pd.DataFrame:
        """The tables of all trays below each other."""
        frames = [
            read_frame(self.folder / f'tray_{number}_{name}.csv')
            for number in self._measured.trays
        ]
        probability = self._measured.provenance.settings.cooling.probability
        provenance = frames[0].attrs['provenance']
        return joined(frames, probability=probability, provenance=provenance)

    def _figure(self) -> Figure:
        from nanorocks_ros.studies.measure.measure_figure import measure_figure

        first = min(self._measured.trays)
        speeds, contacts, cor = (
            {
                str(name): column.to_numpy()
                for name, column in frame[frame['tray'] == first].items()
            }
            for frame in (self.speeds, self.contacts, self.cor)
        )
        return measure_figure(None, speeds, contacts, cor)

    def _summary(self) -> Summary:
        names = 'restitution', 'restitution_lower', 'restitution_upper'
        rows = []
        for _, row in self.cor.iterrows():
            value, lower, upper = (float(row[name]) for name in names)
            interval = with_interval(value, (lower, upper))
            rows.append((f'{row["tray"]}', f'{row["partner"]}', interval, f'{row["contacts"]}'))
        lines = []
        for tray in self._measured.trays.values():
            own = tray['lines']
            unknown = [line for line in own[2:] if _UNKNOWN.search(line)]
            lines += [*tray['recognition'], *own[:2], *unknown, *tray['decay']]
        return Summary(
            title=f'{self.provenance["film"]}{self._verdict}; '
            f'report in {self.folder / "report.html"}',
            head=('tray', 'contacts of beads with', 'COR', 'contacts'),
            rows=tuple(rows),
            lines=(*map(python_words, lines), *self.notices),
        )
