"""The result of `analyse`: speeds, contacts, clusters and restitutions of many cycles.

Tested by ``test/interface/test_analysis.py``.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import pandas as pd

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.python_words import python_words
from nanorocks_ros.interface.record_frames import frame_of, joined, table_frame, with_column
from nanorocks_ros.interface.results.combined_cycles import combined_frame
from nanorocks_ros.interface.results.result import NamedTable, Result, Summary, run_words
from nanorocks_ros.outputs.html_report import with_interval
from nanorocks_ros.outputs.named_recordings import with_recording
from nanorocks_ros.outputs.safe_text import counted
from nanorocks_ros.records import CorEstimate, headline_in_words
from nanorocks_ros.records.result_words import reason_of
from nanorocks_ros.studies.analysis.results.cycle_words import (
    cycle_as_json,
    tray_reason,
    used_speeds,
    wall_prior,
)
from nanorocks_ros.studies.analysis.results.results_folder import FORMATS, write_results
from nanorocks_ros.studies.analysis.results.results_json import (
    end_of_cycle,
    ends_of_cycles,
    last_of_each_cycle,
)
from nanorocks_ros.studies.analysis.results.tracks_files import columns_of, track_pieces
from nanorocks_ros.studies.results.contact_columns import CONTACT_COLUMNS, contact_arrays
from nanorocks_ros.wire.products import MEASURED

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods
    from nanorocks_ros.records import PairCollision, Rebound
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis, TrayResults

# Cycles that a summary lists before it counts the others.
_MOST_SHOWN = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysedRecording:
    """One recording and what was measured in it.

    Parameters
    ----------
    name, path : str
        Of the recording, for tables and for commands in remedies.
    source : Path
    settings : PipelineSettings
    analysis : Analysis
    tracked : TrackedBag or None
        Its tracks, where they were kept.
    run : mapping
        Version, date and command of results that were read.
    """

    name: str
    source: Path
    path: str
    settings: PipelineSettings
    analysis: Analysis
    tracked: TrackedBag | None = None
    run: Mapping[str, Any] = field(default_factory=dict)


class AnalysisResult(Result):
    """Speeds, contacts, clusters and restitutions of the cycles of one or many recordings.

    Rows have the columns ``recording``, ``tray`` and ``cycle``; times count from the start of the
    recording. `nanorocks_ros.analyse` and `nanorocks_ros.read` make it.
    """

    speeds = NamedTable('Mean projected speed of the beads of each tray over time.')
    tracks = NamedTable(
        'Place and velocity of each bead in each frame; only with ``keep_tracks=True``.'
    )
    contacts = NamedTable('Collisions of two beads and rebounds from walls, a row for each.')
    clusters = NamedTable('Cluster sizes, correlation lengths and sticking over time.')
    cor = NamedTable('Coefficient of restitution of each cycle, with intervals of 68 and 95 %.')
    combined = NamedTable('Coefficient of restitution of each tray by all cycles together.')

    def __init__(self, recordings: Sequence[AnalysedRecording], notices: tuple[str, ...]) -> None:
        own = [notice for recording in recordings for notice in recording.analysis.notices]
        errors = [str(error) for item in recordings if (error := item.analysis.error) is not None]
        super().__init__(
            provenance={
                # Of the first: recordings that are read together were mostly analysed together.
                **run_words(recordings[0].run),
                'recordings': ', '.join(recording.name for recording in recordings),
            },
            notices=(*notices, *own, *errors),
            usable=all(recording.analysis.usable for recording in recordings),
        )
        self._recordings = tuple(recordings)

    def save(self, folder: str | Path, form: str = FORMATS[0]) -> None:
        """Write tables and a results bag, as the command ``nanorocks analyse`` does.

        Parameters
        ----------
        folder : path
            Of one recording; of many, each is a folder in it.
        form : 'csv' or 'parquet'

        Raises
        ------
        RecordingError
            When the folder cannot be written, or holds something else.
        """
        from pathlib import Path

        for recording in self._recordings:
            own = Path(folder)
            if len(self._recordings) > 1:
                own = own / recording.name
            write_results(recording.analysis, own, recording.source, recording.settings, form)

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        names = {'speed': 'speeds', 'cluster': 'clusters', 'cor': 'cor_updates'}
        products = {
            names.get(product.name, product.name): partial(self._of_records, product.record)
            for product in MEASURED
        }
        return {
            **products,
            'contacts': self._contacts,
            'cor': self._cor,
            'combined': self._combined,
            'tracks': self._tracks,
        }

    def _joined(self, make: Callable[[AnalysedRecording, int], pd.DataFrame]) -> pd.DataFrame:
        """A frame of every tray of every recording, below each other."""
        frames = [
            with_column(make(recording, tray), 0, 'recording', recording.name)
            for recording in self._recordings
            for tray in recording.analysis.trays
        ]
        return joined(frames, probability=self._probability)

    @property
    def _probability(self) -> float:
        return self._recordings[0].settings.cooling.probability

    def _of_records(self, kind: Any) -> pd.DataFrame:
        return self._joined(
            lambda recording, tray: frame_of(
                kind, recording.analysis.trays[tray].of(kind), recording.analysis.epoch_ns
            )
        )

    def _contacts(self) -> pd.DataFrame:
        def contacts(recording: AnalysedRecording, tray: int) -> pd.DataFrame:
            results = recording.analysis.trays[tray]
            own: list[Rebound | PairCollision] = [*results.rebounds, *results.collisions]
            arrays = contact_arrays(own, recording.analysis.epoch_ns)
            return table_frame(CONTACT_COLUMNS, [arrays])

        return self._joined(contacts)

    def _cor(self) -> pd.DataFrame:
        def cycles(recording: AnalysedRecording, tray: int) -> pd.DataFrame:
            cors = last_of_each_cycle(recording.analysis.trays[tray].cors)
            frame = frame_of(CorEstimate, cors, recording.analysis.epoch_ns)
            reasons = [reason_of(cor) for cor in cors]
            texts = [why and f'{why.text}; {why.remedy}' for why in reasons]
            texts = with_recording(texts, recording.path)
            return with_column(frame, len(frame.columns), 'reason', pd.Series(texts, dtype=object))

        return self._joined(cycles)

    def _combined(self) -> pd.DataFrame:
        frame = combined_frame(self._evidence())
        frame.attrs['probability'] = self._probability
        return frame

    def _evidence(self) -> dict[int, tuple[PipelineSettings, CycleLikelihoods]]:
        """What all cycles of a tray say, and the settings by which they were read."""
        added: dict[int, tuple[PipelineSettings, CycleLikelihoods]] = {}
        for recording in self._recordings:
            for tray, results in recording.analysis.trays.items():
                if results.evidence is None:
                    continue
                if tray in added:
                    settings, evidence = added[tray]
                    added[tray] = settings, evidence + results.evidence
                else:
                    added[tray] = recording.settings, results.evidence
        return added

    def _tracks(self) -> pd.DataFrame:
        def tracks(recording: AnalysedRecording, tray: int) -> pd.DataFrame:
            tracked = recording.tracked
            if tracked is None:
                raise ConfigurationError(
                    'tracks', 'were not kept', 'analyse with keep_tracks=True, or use nr.track'
                )
            own = replace(tracked, trays={tray: tracked.trays[tray]})
            return table_frame(columns_of(own), track_pieces(own))

        return self._joined(tracks)

    def _figure(self) -> Figure:
        from nanorocks_ros.interface.results.campaign_figure import campaign_figure

        return campaign_figure(self.speeds, self.cor, self.combined)

    def _summary(self) -> Summary:
        rows: list[tuple[str, ...]] = []
        flags: dict[str, list[str]] = defaultdict(list)
        lines: list[str] = []
        for recording in self._recordings:
            for tray, results in recording.analysis.trays.items():
                rows += _cycle_rows(recording, tray, results, flags)
                wrong: list[str] = []
                reason = tray_reason(results)
                if reason is not None:
                    wrong.append(f'tray {tray}: no COR: {reason.text}; {reason.remedy}')
                if not all(verdict.usable for verdict in results.verdicts):
                    wrong += [line for verdict in results.verdicts for line in verdict.lines()]
                lines += with_recording(wrong, recording.path)
        lines += [
            f'{with_recording(text, paths[0])} ({counted(len(paths), "cycle")})'
            for text, paths in flags.items()
        ]
        title = f'{counted(len(self._recordings), "recording")}, {counted(len(rows), "cycle")}'
        left_out = len(rows) - _MOST_SHOWN
        if left_out > 0:
            lines.insert(0, f'{counted(left_out, "cycle")} more: see .cor')
        return Summary(
            title=title + self._verdict,
            head=('recording', 'tray', 'cycle', 'COR of beads', 'COR of walls', 'from'),
            rows=tuple(rows[:_MOST_SHOWN]),
            lines=tuple(python_words(line) for line in (*lines, *self.notices)),
        )


def _cycle_rows(
    recording: AnalysedRecording, tray: int, results: TrayResults, flags: dict[str, list[str]]
) -> list[tuple[str, ...]]:
    """A row of the summary for each cycle; `flags` gets the recording for each flag."""
    cycles = last_of_each_cycle(results.cors)
    used = used_speeds(results.speeds, cycles, wall_prior(recording.analysis.prior))
    ends = ends_of_cycles(results.clusters)
    rows: list[tuple[str, ...]] = []
    for cor, speeds in zip(cycles, used, strict=True):
        words = cycle_as_json(cor, end_of_cycle(ends, cor), speeds)
        reason = words['reason']
        if reason is not None:
            flags[f'no COR: {reason["text"]}; {reason["remedy"]}'].append(recording.path)
        for flag in words['flags']:
            name = flag['name'].replace('_', ' ')
            flags[f'{name}: {flag["text"]}; {flag["remedy"]}'].append(recording.path)
        beads, walls = (
            with_interval(value.value, (value.lower, value.upper))
            for value in (cor.restitution, cor.wall_restitution)
        )
        source = headline_in_words(cor.headline, cor.tension, cor.wall_friction, cor.quality)
        rows.append((recording.name, f'{tray}', f'{cor.cycle}', beads, walls, source))
    return rows
