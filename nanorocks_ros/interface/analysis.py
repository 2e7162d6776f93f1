"""Analyse recordings: `nanorocks_ros.analyse`."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.interface.inputs import named_paths, recording, settings_of, told_settings
from nanorocks_ros.interface.progress_bars import count_bar
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.interface.results.analysis_result import AnalysedRecording, AnalysisResult
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import Tracks
from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
from nanorocks_ros.studies.analysis.offline_analysis import analyse as analyse_bag

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from nanorocks_ros.interface.inputs import PathLike
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.offline_analysis import Analysis


def analyse(
    recordings: PathLike | Iterable[PathLike],
    *,
    trays: Sequence[int] | int | None = None,
    trays_file: PathLike = '',
    settings: Mapping[str, Any] | None = None,
    image_topic: str = '',
    keep_tracks: bool = False,
    progress: bool = True,
) -> AnalysisResult:
    """Measure the cycles of recordings: speeds, contacts, clusters, restitutions.

    It is what the command ``nanorocks analyse`` does, for trays that are shaken again and again.
    For any other film see `measure`.

    Parameters
    ----------
    recordings : path or iterable of paths
        Bags, videos or folders of images; patterns, and folders of recordings.
    trays : int or sequence of int, optional
        Numbers of the trays; default: those that the recording names.
    trays_file : path, optional
        YAML file of trays other than those that flew.
    settings : mapping, optional
        Settings by their names, such as ``{'cooling.duration': 15}``;
        ``nanorocks analyse --help-all`` lists them.
    image_topic : str, optional
        The camera's topic if it has another name than that of our nodes.
    keep_tracks : bool
        Whether to keep the tracks of all beads, for ``.tracks``: 100 bytes for each bead and
        frame.
    progress : bool
        Whether to show bars, on a terminal or in a notebook.

    Returns
    -------
    AnalysisResult

    Raises
    ------
    RecordingError
        When a recording cannot be read.
    ConfigurationError
        For an unknown setting, or a value that cannot be.
    FrameError
        When no frame of a recording can be used.
    """
    with in_python():
        told = told_settings(settings, trays, trays_file)
        analysed: list[AnalysedRecording] = []
        notices: list[str] = []
        for path in named_paths(recordings):
            own = recording(path, progress=progress)
            recorded = settings_of(own.bag, told, image_topic)
            notices += own.named((*own.notices, *recorded.notices))
            kept = _KeptTracks() if keep_tracks else None
            with count_bar(f'analysing {own.name}', shown=progress) as show:
                analysis = analyse_bag(
                    own.bag,
                    recorded.settings,
                    image_topic=image_topic,
                    progress=show,
                    scratch=Path(tempfile.gettempdir()),
                    observer=kept,
                )
            analysis.notices[:] = own.named(analysis.notices)
            analysed.append(
                AnalysedRecording(
                    name=own.name,
                    source=own.bag,
                    path=str(own.bag),
                    settings=recorded.settings,
                    analysis=analysis,
                    tracked=None if kept is None else kept.tracked(analysis, recorded.settings),
                )
            )
        return AnalysisResult(analysed, tuple(notices))


class _KeptTracks:
    """Keeps the tracks of an analysis."""

    def __init__(self) -> None:
        self._tracks: list[Tracks] = []

    def __call__(self, record: object) -> None:
        """Keep a record that holds tracks."""
        if isinstance(record, Tracks):
            self._tracks.append(record)

    def tracked(self, analysis: Analysis, settings: PipelineSettings) -> TrackedBag:
        """All tracks, by tray."""
        numbers = {stamp: number for number, stamp in enumerate(analysis.stamps_ns)}
        trays, film = trays_of(settings), film_section(settings.trays_file)
        of_trays = {
            tray: [record for record in self._tracks if record.tray == tray] for tray in trays
        }
        return TrackedBag(
            epoch_ns=analysis.epoch_ns,
            pixels_per_metre=settings.preprocess.pixels_per_metre,
            trays=trays,
            tracks=of_trays,
            numbers={
                tray: [numbers[record.stamp_ns] for record in records]
                for tray, records in of_trays.items()
            },
            regions={} if film is None else dict.fromkeys(trays, Region(*film.region_px)),
            film=film,
        )
