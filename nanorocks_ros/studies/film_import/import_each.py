"""A bag of each video of a campaign: what is done is left, what fails is told at the end."""

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
from nanorocks_ros.studies.film_import.import_film import Imported, import_films

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from nanorocks_ros.studies.film_import.film_inputs import ImportSettings

# Bags get their name when they are complete.
_UNFINISHED = '.unfinished'


@dataclass(slots=True, kw_only=True)
class ImportedEach:
    """What became of each of many films.

    Parameters
    ----------
    folder : Path
    imported : list of Imported
    skipped : list of Path
        Bags that were complete before.
    failed : dict of Path to NanorocksError
        By film.
    """

    folder: Path
    imported: list[Imported] = field(default_factory=list)
    skipped: list[Path] = field(default_factory=list)
    failed: dict[Path, NanorocksError] = field(default_factory=dict)


def import_each(
    films: Sequence[Path],
    folder: Path,
    settings: ImportSettings,
    progress: Callable[[float, str], None],
) -> ImportedEach:
    """Make a bag of each film; what cannot be imported does not keep the others from it.

    Parameters
    ----------
    films : sequence of Path
    folder : Path
        Of the bags; may exist. Complete bags in it are left as they are.
    settings : ImportSettings
    progress : callable
        Called with the share that is done, and the film in hand.

    Returns
    -------
    ImportedEach

    Raises
    ------
    ConfigurationError
        When the settings fit no film, whatever it is.
    RecordingError
        When the folder cannot be written.
    """
    found = ImportedEach(folder=folder)
    names = _names(films)
    unfinished = folder / _UNFINISHED
    try:
        unfinished.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(
            str(folder), f'cannot be written ({error.strerror})', 'pass another folder'
        ) from error
    for number, film in enumerate(films):

        def tell(share: float, number: int = number, film: Path = film) -> None:
            progress((number + share) / len(films), film.name)

        try:
            _import_one(film, names[film], settings, found, tell)
        except NanorocksError as error:
            found.failed[film] = error
        tell(1.0)
    with suppress(OSError):
        unfinished.rmdir()
    return found


def _names(films: Sequence[Path]) -> dict[Path, str]:
    """The bag's name for each film: with the ending, too, where two would have the same."""
    stems = Counter(film.stem for film in films)
    names = {
        film: film.stem if stems[film.stem] == 1 else film.name.replace('.', '_') for film in films
    }
    for name, count in Counter(names.values()).items():
        if count > 1:
            raise ConfigurationError(
                '--each', f'{count} films would become {name}', 'import them into two folders'
            )
    return names


def _import_one(
    film: Path,
    name: str,
    settings: ImportSettings,
    found: ImportedEach,
    tell: Callable[[float], None],
) -> None:
    bag = found.folder / name
    if bag.exists():
        check_same_source(bag, film)
        check_same_settings(bag, settings)
        found.skipped.append(bag)
        return
    part = found.folder / _UNFINISHED / name
    try:
        # Begun earlier, and never completed.
        shutil.rmtree(part, ignore_errors=True)
        imported = import_films([film], part, settings, tell)
        part.rename(bag)
    except OSError as error:
        raise RecordingError(
            str(bag), f'cannot be written ({error.strerror})', 'make room, or pass another folder'
        ) from error
    imported.bag = bag
    found.imported.append(imported)
