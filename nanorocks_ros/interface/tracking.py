"""Track the beads of a film: `nanorocks_ros.track`.

Tested by ``test/interface/test_measuring.py``.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2

from nanorocks_ros.interface.inputs import described, told_settings
from nanorocks_ros.interface.progress_bars import count_bar
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.interface.record_frames import table_frame
from nanorocks_ros.interface.results.result import NamedTable, Result, Summary
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import TWO_COLUMNS
from nanorocks_ros.outputs.named_recordings import with_recording
from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag, track_bag
from nanorocks_ros.studies.analysis.results.tracks_files import columns_of, track_pieces
from nanorocks_ros.studies.inspection.track_overlay import overlay

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import pandas as pd
    from matplotlib.figure import Figure
    from typing_extensions import Unpack

    from nanorocks_ros.interface.inputs import FilmDescription, PathLike

# Height of a title, [mm].
_TITLE = 10.0


def track(
    film: PathLike,
    *,
    trays: Sequence[int] | int | None = None,
    trays_file: PathLike = '',
    settings: Mapping[str, Any] | None = None,
    image_topic: str = '',
    progress: bool = True,
    **description: Unpack[FilmDescription],
) -> TrackResult:
    """Follow every bead of a film from frame to frame.

    It is what the command ``nanorocks track`` does.

    Parameters
    ----------
    film : path
        Video, folder of images, or bag.
    trays, trays_file, settings, image_topic, progress
        As of `analyse`.
    **description
        What is known of the beads and the container, as `FilmDescription`; ``diameter_px`` is
        enough.

    Returns
    -------
    TrackResult

    Raises
    ------
    RecordingError
        When the film cannot be read.
    ConfigurationError
        For an unknown keyword or setting, or values that do not fit each other or the picture.
    FrameError
        When no frame can be used.
    """
    with in_python():
        told = told_settings(settings, trays, trays_file)
        own = described(film, told, description, image_topic=image_topic, progress=progress)
        with count_bar(f'tracking {own.recording.name}', shown=progress) as show:
            tracked = track_bag(
                own.recording.bag, own.recorded.settings, image_topic=image_topic, progress=show
            )
        return TrackResult(
            tracked, Path(film), (*own.notices, *own.recording.named(tracked.notices))
        )


class TrackResult(Result):
    """Tracks of all beads of a film. `nanorocks_ros.track` makes it."""

    tracks = NamedTable('Place and velocity of each bead in each frame.')

    def __init__(self, tracked: TrackedBag, film: Path, notices: tuple[str, ...]) -> None:
        name = film.resolve().name
        super().__init__(provenance={'film': name}, notices=notices, usable=tracked.usable)
        self._tracked, self._film = tracked, film

    def _makers(self) -> dict[str, Callable[[], pd.DataFrame]]:
        own = self._tracked
        return {'tracks': lambda: table_frame(columns_of(own), track_pieces(own))}

    def _figure(self) -> Figure:
        return tracks_figure(self._tracked)

    def _summary(self) -> Summary:
        rows = [
            (f'{number}', f'{len(records)}', f'{_tracks_in(records)}')
            for number, records in self._tracked.tracks.items()
        ]
        lines = [
            with_recording(line, self._film)
            for verdicts in self._tracked.verdicts.values()
            for verdict in verdicts
            for line in verdict.lines()
        ]
        return Summary(
            title=f'tracks of {self.provenance["film"]}{self._verdict}',
            head=('tray', 'frames', 'tracks'),
            rows=tuple(rows),
            lines=(*lines, *self.notices),
        )


def _tracks_in(records: Sequence[Any]) -> int:
    return len({number for record in records for number in record.ids.tolist()})


def tracks_figure(tracked: TrackedBag) -> Figure:
    """The last picture of each tray with the beads and their paths."""
    pictures = {
        number: overlay(image, tracked.tracks[number], tracked.pixels_per_metre)
        for number, image in sorted(tracked.pictures.items())
    }
    heights = [
        _TITLE + TWO_COLUMNS * picture.shape[0] / picture.shape[1] for picture in pictures.values()
    ]
    with figure_file(None, TWO_COLUMNS, sum(heights)) as figure:
        rows = figure.subplots(len(pictures), 1, squeeze=False, height_ratios=heights)
        for axes, (number, picture) in zip(rows[:, 0], pictures.items(), strict=True):
            axes.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
            axes.set_title(f'tray {number}: beads, and their paths of one second')
            axes.set_axis_off()
    return figure
