"""Recordings, settings and descriptions of films, as a user of Python names them."""

from __future__ import annotations

import glob
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

from nanorocks_ros.errors import ConfigurationError, RecordingError, did_you_mean
from nanorocks_ros.experiment.recorded_experiment import RecordedSettings, recorded_settings
from nanorocks_ros.interface.progress_bars import part_bar
from nanorocks_ros.outputs.named_recordings import with_film
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.recordings.bag.find_bags import find_bags, is_collection, is_pattern
from nanorocks_ros.recordings.film.natural_sort import natural_key
from nanorocks_ros.settings import PipelineSettings, rows, with_values
from nanorocks_ros.studies.film_import.film_cache import cached_import, is_film
from nanorocks_ros.studies.film_import.named_film import check_film_or_bag
from nanorocks_ros.studies.measure.found_diameters import with_found_diameters
from nanorocks_ros.studies.measure.told_film import described_film

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    PathLike = str | os.PathLike[str]


class FilmDescription(TypedDict, total=False):
    """What may be told of a film in place of a trays file, each species having its own values.

    Parameters
    ----------
    diameter_px : float or 'auto', [px]
        Of the beads in the picture; needed; "auto": found in the film.
    diameter_mm : float, [mm]
        Of the beads; gives the scale.
    count : int
        Number of beads; the decay needs it.
    look : 'auto', 'bright' or 'dark'
        On the floor.
    colour : str
        Name, ``#rrggbb`` or ``auto``.
    material : str
        Its name; "beads" where it is not told.
    density_g_cm3 : float, [g/cm^3]
        Of the beads; matters where species collide.
    corners : sequence of float, [px]
        Column and row of two opposite corners of the container, or of all four.
    sides_mm : tuple of 2 floats, [mm]
        Inner sides of the container, along columns and rows.
    height_mm : float, [mm]
        Inner height of the container, along the line of sight.
    """

    diameter_px: float | str | Sequence[float | str]
    diameter_mm: float | Sequence[float]
    count: int | Sequence[int]
    look: str | Sequence[str]
    colour: str | Sequence[str]
    material: str | Sequence[str]
    density_g_cm3: float | Sequence[float]
    corners: Sequence[float]
    sides_mm: tuple[float, float]
    height_mm: float


@dataclass(slots=True, kw_only=True)
class ToldByKeywords:
    """A description as the studies want it: lists for species, None where nothing is told."""

    diameter_px: Sequence[float | str] | None = None
    diameter_mm: Sequence[float] | None = None
    count: Sequence[int] | None = None
    look: Sequence[str] | None = None
    colour: Sequence[str] | None = None
    material: Sequence[str] | None = None
    density_g_cm3: Sequence[float] | None = None
    corners: Sequence[float] | None = None
    sides_mm: Sequence[float] | None = None
    height_mm: float | None = None


class Recording(NamedTuple):
    """A recording, imported if it is a film.

    Parameters
    ----------
    bag : Path
    name : str
        What the user named, without its folder.
    notices : tuple of str
        Of the import.
    imported : bool
        Whether the bag was made of a film.
    """

    bag: Path
    name: str
    notices: tuple[str, ...] = ()
    imported: bool = False

    def named(self, notices: Iterable[str]) -> tuple[str, ...]:
        """Notices that name a film where they name its import."""
        if not self.imported:
            return tuple(notices)
        return tuple(with_film(notice, self.bag, self.name) for notice in notices)


def recording(path: PathLike, *, progress: bool) -> Recording:
    """The recording of a path; a film is imported beside itself, once.

    Raises
    ------
    RecordingError
        When there is none, or something else, or it cannot be imported.
    """
    own = Path(path).expanduser()
    name = own.resolve().name
    check_film_or_bag(str(own))
    if not is_film(own):
        return Recording(own, name)
    with part_bar(f'importing {name}', shown=progress) as show:
        film = cached_import(own, show)
    return Recording(film.bag, name, film.notices, imported=True)


def named_paths(recordings: PathLike | Iterable[PathLike]) -> list[Path]:
    """The paths of recordings: one or many, patterns and folders of recordings included.

    Raises
    ------
    RecordingError
        When nothing is named, or a pattern matches nothing.
    """
    texts = [recordings] if isinstance(recordings, str | os.PathLike) else [*recordings]
    paths = [path for text in texts for path in _expanded(str(Path(text).expanduser()))]
    if not paths:
        raise RecordingError('recordings', 'none is named', 'name a bag, a video, or many')
    return paths


def _expanded(text: str) -> list[Path]:
    if is_pattern(text):
        matches = sorted(glob.glob(text, recursive=True), key=natural_key)
        if not matches:
            raise RecordingError(text, 'matches nothing', 'correct the pattern')
        return [Path(match) for match in matches]
    return find_bags([text]).bags if is_collection(Path(text)) else [Path(text)]


def told_settings(
    settings: Mapping[str, Any] | None, trays: Sequence[int] | int | None, trays_file: PathLike
) -> dict[str, Any]:
    """The settings by name that are told, by a mapping and by keywords of their own."""
    told = dict(settings or {})
    if trays is not None:
        told['trays'] = [trays] if isinstance(trays, int) else list(trays)
    if trays_file:
        told['trays_file'] = str(trays_file)
    return told


def settings_of(bag: Path, told: Mapping[str, Any], image_topic: str = '') -> RecordedSettings:
    """Settings of the pipeline: what is told, else what the recording says, else defaults.

    Raises
    ------
    ConfigurationError
        For an unknown name, or a value that cannot be.
    RecordingError
        When the recording cannot be read.
    """
    settings = with_values(PipelineSettings(), told, 'settings')
    names = {row.deprecated: row.name for row in rows(settings) if row.deprecated}
    current = {names.get(name, name) for name in told}
    settings, notices = with_found_diameters(settings, current, bag, image_topic)
    recorded = recorded_settings(settings, current, read_metadata(bag), str(bag))
    return recorded._replace(notices=(*notices, *recorded.notices))


class DescribedFilm(NamedTuple):
    """A recording with its settings, and what the user should know of both."""

    recording: Recording
    recorded: RecordedSettings
    notices: tuple[str, ...]


def described(
    film: PathLike,
    told: dict[str, Any],
    film_told: Mapping[str, Any],
    *,
    image_topic: str = '',
    progress: bool,
) -> DescribedFilm:
    """A film with the settings that follow from what is told of it.

    Parameters
    ----------
    film : path
    told : dict
        Settings by name.
    film_told : mapping
        As `FilmDescription`.
    image_topic : str, optional
    progress : bool

    Raises
    ------
    ConfigurationError
        For names that are unknown, and values that do not fit each other or the picture.
    RecordingError
        When the film cannot be read.
    """
    own = recording(film, progress=progress)
    told_film = _told_film(film_told)
    trays_file = str(told.get('trays_file', ''))
    tray = described_film(told_film, own.bag, image_topic, trays_file)
    notices = own.notices
    if tray is not None:
        told['trays_file'] = tray.text
        notices += tray.notices
    recorded = settings_of(own.bag, told, image_topic)
    return DescribedFilm(own, recorded, own.named(notices + recorded.notices))


def _told_film(values: Mapping[str, Any]) -> ToldByKeywords:
    """The description with a list for each species."""
    known = FilmDescription.__annotations__
    for name in values:
        if name not in known:
            hint = did_you_mean(name, list(known))
            meant = f'; {hint}' if hint else ''
            raise ConfigurationError(
                name, f'is no keyword{meant}', f'choose from {", ".join(known)}'
            )
    single = 'height_mm', 'corners', 'sides_mm'
    lists: dict[str, Any] = {
        name: value if name in single or value is None else _as_list(value)
        for name, value in values.items()
    }
    return ToldByKeywords(**lists)


def _as_list(value: Any) -> list[Any]:
    is_single = isinstance(value, str) or not hasattr(value, '__iter__')
    return [value] if is_single else list(value)
