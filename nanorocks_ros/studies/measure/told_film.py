"""What a user tells of a film, in mm and px, by options of a command or by keywords of Python.

Tested by ``test/cli/films/test_film_options.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.studies.measure.film_samples import FilmSamples, film_samples
from nanorocks_ros.studies.measure.film_tray import (
    DescribedTray,
    FilmedBeads,
    FilmedTray,
    described_tray,
)
from nanorocks_ros.studies.measure.found_diameters import guessed_diameter
from nanorocks_ros.studies.measure.species_sizes import (
    FoundDiameter,
    SpeciesLook,
    species_sizes,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

_MM = 1e-3
# Of beads whose size is not known yet.
_NOMINAL_PX = 1.0


class ToldFilm(Protocol):
    """What is told of a film; lists have a value for each species, None: not told."""

    diameter_px: Sequence[float | str] | None
    diameter_mm: Sequence[float] | None
    count: Sequence[int] | None
    look: Sequence[str] | None
    colour: Sequence[str] | None
    material: Sequence[str] | None
    density_g_cm3: Sequence[float] | None
    corners: Sequence[float] | None
    sides_mm: Sequence[float] | None
    height_mm: float | None


def described_film(
    told: ToldFilm, bag: Path, image_topic: str, trays_file: str
) -> DescribedTray | None:
    """The trays file that is told in the place of one; None without a diameter in pixels.

    A diameter that is ``auto`` is found in the film.

    Raises
    ------
    ConfigurationError
        For values that do not fit each other or the picture, or beside a trays file.
    RecordingError
        When the recording cannot be read.
    """
    filmed = filmed_tray(told)
    if filmed is None:
        return None
    if trays_file:
        raise ConfigurationError(
            '--diameter-px', 'and --trays-file both describe the beads', 'leave out one of them'
        )
    if not any(math.isnan(beads.diameter_px) for beads in filmed.beads):
        return described_tray(filmed, film_samples(bag, image_topic).size)
    samples = film_samples(bag, image_topic, whole=True)
    sized, notice = sized_beads(filmed, samples)
    described = described_tray(sized, samples.size)
    return replace(described, notices=(notice, *described.notices))


def sized_beads(filmed: FilmedTray, samples: FilmSamples) -> tuple[FilmedTray, str]:
    """The beads with the diameter that the film shows, where none is told, and a notice.

    Raises
    ------
    ConfigurationError
        When no discs of one size stand out, or not as many sizes as species that look alike.
    """
    # Of any size, for the region and the looks.
    nominal = _of_sizes(filmed, [_NOMINAL_PX] * len(filmed.beads))
    text = described_tray(nominal, samples.size).text
    section, species = film_section(text), load_trays(text)[1].species
    assert section is not None
    crops = [section.crop(frame) for frame in samples.frames]
    looks = [
        SpeciesLook(
            sign=kind.appearance.sign,
            colour=kind.appearance.colour,
            diameter=told.diameter_px,
            order=told.diameter or 0.0,
        )
        for kind, told in zip(species, filmed.beads, strict=True)
        if kind.appearance is not None
    ]
    sizes = _guessed_sizes(crops, looks)
    unknown = [k for k, look in enumerate(looks) if math.isnan(look.diameter)]
    names = (
        ['the diameter']
        if len(looks) == 1
        else [f'the diameter of {kind.material}' for kind in species]
    )
    shown = '; '.join(f'{names[k]} is guessed: {sizes[k]}' for k in unknown)
    diameters = [
        round(size.diameter, 2) if math.isnan(look.diameter) else look.diameter
        for look, size in zip(looks, sizes, strict=True)
    ]
    return _of_sizes(filmed, diameters), f'{shown}; --diameter-px sets it'


def _guessed_sizes(
    crops: Sequence[NDArray[np.uint8]], looks: Sequence[SpeciesLook]
) -> tuple[FoundDiameter, ...]:
    if len(looks) == 1:
        return (guessed_diameter(crops, BeadLook(sign=looks[0].sign, colour=looks[0].colour)),)
    sizes = species_sizes(crops, looks)
    if isinstance(sizes, str):
        raise ConfigurationError(
            '--diameter-px',
            f'cannot be guessed: {sizes}',
            'measure a bead of each, or mark them: nanorocks tray FILM --browse -o mine.yaml',
        )
    return sizes


def _of_sizes(filmed: FilmedTray, diameters_px: Sequence[float]) -> FilmedTray:
    species = zip(filmed.beads, diameters_px, strict=True)
    return replace(
        filmed, beads=tuple(replace(beads, diameter_px=size) for beads, size in species)
    )


def filmed_tray(told: ToldFilm) -> FilmedTray | None:
    """What is told of the film; None without a diameter in pixels.

    Raises
    ------
    ConfigurationError
        For lists of different lengths, and numbers that cannot be.
    """
    _check(told)
    if not told.diameter_px:
        return None
    sides = told.sides_mm
    pairs = told.corners or []
    return FilmedTray(
        beads=tuple(_beads(told, k) for k in range(len(told.diameter_px))),
        corners_px=tuple(zip(pairs[::2], pairs[1::2], strict=True)),
        sides=None if sides is None else (_MM * sides[0], _MM * sides[1]),
        height=None if told.height_mm is None else _MM * told.height_mm,
    )


def _beads(told: ToldFilm, k: int) -> FilmedBeads:
    def value(values: Sequence[Any] | None) -> Any:
        return None if values is None else values[k]

    size, diameter = value(told.diameter_px), value(told.diameter_mm)
    return FilmedBeads(
        diameter_px=math.nan if size == AUTO else size,
        diameter=None if diameter is None else _MM * diameter,
        count=value(told.count),
        density=value(told.density_g_cm3),
        look=value(told.look) or AUTO,
        colour=value(told.colour) or AUTO,
        material=value(told.material) or '',
    )


def _check(told: ToldFilm) -> None:
    lists: dict[str, Sequence[Any] | None] = {
        '--diameter-mm': told.diameter_mm,
        '--count': told.count,
        '--density-g-cm3': told.density_g_cm3,
    }
    words: dict[str, Sequence[Any] | None] = {
        '--look': told.look,
        '--colour': told.colour,
        '--material': told.material,
    }
    single = [] if told.height_mm is None else [told.height_mm]
    _check_positive({**lists, '--sides-mm': told.sides_mm, '--height-mm': single}, told)
    given = {flag: values for flag, values in (lists | words).items() if values is not None}
    others = {'--corners': told.corners, '--sides-mm': told.sides_mm, '--height-mm': single}
    if not told.diameter_px:
        for flag, values in {**given, **others}.items():
            if values:
                raise ConfigurationError(
                    flag,
                    'needs --diameter-px',
                    f'add the diameter of a bead in the picture, or {AUTO} to find it',
                )
    for flag, values in given.items():
        if told.diameter_px and len(values) != len(told.diameter_px):
            raise ConfigurationError(
                flag,
                f'{len(values)} values for {len(told.diameter_px)} of --diameter-px',
                'give one for each species',
            )
    if told.corners and len(told.corners) not in (4, 8):
        raise ConfigurationError(
            '--corners', f'{len(told.corners)} numbers', 'give two corners or four: X Y X Y'
        )


def _check_positive(lists: Mapping[str, Sequence[Any] | None], told: ToldFilm) -> None:
    sizes = [size for size in told.diameter_px or () if size != AUTO]
    for flag, values in {'--diameter-px': sizes, **lists}.items():
        for value in values or []:
            if isinstance(value, str) or not (math.isfinite(value) and value > 0):
                shown = value if isinstance(value, str) else f'{value:g}'
                raise ConfigurationError(flag, shown, 'give numbers above 0')
