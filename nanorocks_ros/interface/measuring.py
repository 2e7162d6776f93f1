"""Measure a film of any beads: `nanorocks_ros.measure`."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.interface.inputs import described, told_settings
from nanorocks_ros.interface.progress_bars import count_bar
from nanorocks_ros.interface.python_words import in_python
from nanorocks_ros.interface.results.measure_result import MeasureResult
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.named_recordings import with_film, with_recording
from nanorocks_ros.studies.film_import.film_cache import cache_folder
from nanorocks_ros.studies.measure.measure_film import MeasurePlan, measure_film

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from contextlib import AbstractContextManager

    from typing_extensions import Unpack

    from nanorocks_ros.interface.inputs import FilmDescription, PathLike
    from nanorocks_ros.jobs.progress import Progress


def measure(
    film: PathLike,
    *,
    folder: PathLike | None = None,
    trays: Sequence[int] | int | None = None,
    trays_file: PathLike = '',
    settings: Mapping[str, Any] | None = None,
    image_topic: str = '',
    workers: int | None = None,
    progress: bool = True,
    **description: Unpack[FilmDescription],
) -> MeasureResult:
    """Measure a film: tracks, speeds, contacts, restitutions.

    It is what the command ``nanorocks measure`` does. Beads may have any look and move for any
    reason; nothing has to be shaken. With container and number of beads known the decay of their
    speeds is read as well, which takes minutes the first time.

    Parameters
    ----------
    film : path
        Video, folder of images, or bag.
    folder : path, optional
        For tables, pictures and a report; default: ``.nanorocks/NAME_measured`` beside the film.
        The same call takes finished steps from there.
    trays, trays_file, settings, image_topic, progress
        As of `analyse`.
    workers : int, optional
        Processes for the simulated decays; default: one for each core.
    **description
        What is known of the beads and the container, as `FilmDescription`; ``diameter_px`` is
        enough.

    Returns
    -------
    MeasureResult

    Raises
    ------
    RecordingError
        When the film cannot be read, or the results not be written.
    ConfigurationError
        For an unknown keyword or setting, values that do not fit each other or the picture, or
        when nothing is told of the beads.
    FrameError
        When no frame can be used.
    """
    with in_python():
        told = told_settings(settings, trays, trays_file)
        own = described(film, told, description, image_topic=image_topic, progress=progress)
        if not own.recorded.trays_known:
            raise ConfigurationError(
                own.recording.name,
                'nothing is known of its beads',
                'give their diameter in the picture, as diameter_px=31 or "auto", or a trays_file',
            )
        plan = MeasurePlan(
            bag=own.recording.bag,
            name=own.recording.name,
            folder=_folder(film) if folder is None else Path(folder).expanduser(),
            settings=own.recorded.settings,
            image_topic=image_topic,
            workers=Workers(processes=workers),
            name_files=partial(_with_own_film, bag=own.recording.bag, film=Path(film)),
        )
        teller = _Teller(shown=progress)
        measure_film(plan, teller)
        return MeasureResult(plan.folder, own.notices)


def _with_own_film(text: str, bag: Path, film: Path) -> str:
    """A text that names the film, and whose commands do."""
    named: str = with_recording(with_film(text, bag, film), film)
    return named


def _folder(film: PathLike) -> Path:
    return cache_folder(Path(film)) / f'{Path(film).resolve().name}_measured'


class _Teller:
    """Bars; what the study tells in lines is in its result."""

    def __init__(self, *, shown: bool) -> None:
        self._shown = shown

    def say(self, line: str) -> None:
        """Nothing: the result holds the line."""

    def progress(self, label: str) -> AbstractContextManager[Progress]:
        """A bar."""
        return count_bar(label, shown=self._shown)
