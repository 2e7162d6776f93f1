"""Import of many films, each into its own bag; existing bags are skipped, errors collected."""

from __future__ import annotations

import shutil
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError, NanorocksError, RecordingError
from nanorocks_ros.studies.film_import.existing_import import (
    check_same_settings,
    check_same_source,
)
from nanorocks_ros.studies.film_import.import_film import import_films

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
    from nanorocks_ros.studies.film_import.import_result import ImportResult

# Folder of incomplete bags; a complete bag is moved out of it.
_UNFINISHED = '.unfinished'


@dataclass(slots=True, kw_only=True)
class ImportBatch:
    """Result of an import of many films.

    Parameters
    ----------
    folder : Path
        Folder of the bags.
    imported : list of ImportResult
    skipped : list of Path
        Bags that were complete before.
    failed : dict of Path to NanorocksError
        Error of each film that could not be imported.
    """

    folder: Path
    imported: list[ImportResult] = field(default_factory=list)
    skipped: list[Path] = field(default_factory=list)
    failed: dict[Path, NanorocksError] = field(default_factory=dict)


def import_each(
    films: Sequence[Path],
    folder: Path,
    settings: ImportSettings,
    progress: Callable[[float, str], None],
) -> ImportBatch:
    """Import each film into its own bag; an error does not stop the others.

    Parameters
    ----------
    films : sequence of Path
    folder : Path
        Folder of the bags; may exist. Complete bags in it are not changed.
    settings : ImportSettings
    progress : callable
        Called with the fraction that is done, and the name of the current film.

    Returns
    -------
    ImportBatch

    Raises
    ------
    ConfigurationError
        If two films would get the same bag.
    RecordingError
        If the folder cannot be written.
    """
    batch = ImportBatch(folder=folder)
    names = _bag_names(films)
    unfinished = folder / _UNFINISHED
    try:
        unfinished.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(
            str(folder), f'cannot be written ({error.strerror})', 'pass another folder'
        ) from error
    for number, film in enumerate(films):

        def film_progress(done: float, number: int = number, film: Path = film) -> None:
            progress((number + done) / len(films), film.name)

        try:
            _import_film(film, names[film], settings, batch, film_progress)
        except NanorocksError as error:
            batch.failed[film] = error
        film_progress(1.0)
    with suppress(OSError):
        unfinished.rmdir()
    return batch


def _bag_names(films: Sequence[Path]) -> dict[Path, str]:
    """Name of the bag of each film; it includes the file extension if names would be equal."""
    stems = Counter(film.stem for film in films)
    names = {
        film: film.stem if stems[film.stem] == 1 else film.name.replace('.', '_') for film in films
    }
    for name, count in Counter(names.values()).items():
        if count > 1:
            raise ConfigurationError(
                '--each',
                f'{count} films would become bag {name}',
                'import them into separate folders',
            )
    return names


def _import_film(
    film: Path,
    name: str,
    settings: ImportSettings,
    batch: ImportBatch,
    progress: Callable[[float], None],
) -> None:
    bag = batch.folder / name
    if bag.exists():
        check_same_source(bag, film)
        check_same_settings(bag, settings)
        batch.skipped.append(bag)
        return
    unfinished = batch.folder / _UNFINISHED / name
    try:
        # Left by an interrupted import.
        shutil.rmtree(unfinished, ignore_errors=True)
        imported = import_films([film], unfinished, settings, progress)
        unfinished.rename(bag)
    except OSError as error:
        raise RecordingError(
            str(bag), f'cannot be written ({error.strerror})', 'make room, or pass another folder'
        ) from error
    imported.bag = bag
    batch.imported.append(imported)
