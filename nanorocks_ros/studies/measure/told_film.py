"""What a user tells of a film, in mm and px, by options of a command or by keywords of Python.

Tested by ``test/cli/films/test_film_options.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO
from nanorocks_ros.studies.measure.film_samples import film_samples
from nanorocks_ros.studies.measure.film_tray import (
    DescribedTray,
    FilmedBeads,
    FilmedTray,
    described_tray,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_MM = 1e-3


class ToldFilm(Protocol):
    """What is told of a film; lists have a value for each species, None: not told."""

    diameter_px: Sequence[float] | None
    diameter_mm: Sequence[float] | None
    count: Sequence[int] | None
    look: Sequence[str] | None
    colour: Sequence[str] | None
    density_g_cm3: Sequence[float] | None
    corners: Sequence[float] | None
    sides_mm: Sequence[float] | None
    height_mm: float | None


def described_film(
    told: ToldFilm, bag: Path, image_topic: str, trays_file: str
) -> DescribedTray | None:
    """The trays file that is told in the place of one; None without a diameter in pixels.

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
    return described_tray(filmed, film_samples(bag, image_topic).size)


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
    def value(values: list[Any] | None) -> Any:
        return None if values is None else values[k]

    diameter = value(told.diameter_mm)
    return FilmedBeads(
        diameter_px=told.diameter_px[k],
        diameter=None if diameter is None else _MM * diameter,
        count=value(told.count),
        density=value(told.density_g_cm3),
        look=value(told.look) or AUTO,
        colour=value(told.colour) or AUTO,
    )


def _check(told: ToldFilm) -> None:
    lists = {
        '--diameter-px': told.diameter_px,
        '--diameter-mm': told.diameter_mm,
        '--count': told.count,
        '--density-g-cm3': told.density_g_cm3,
    }
    words = {'--look': told.look, '--colour': told.colour}
    single = [] if told.height_mm is None else [told.height_mm]
    positive = {**lists, '--sides-mm': told.sides_mm, '--height-mm': single}
    for flag, values in positive.items():
        for value in values or []:
            if not (math.isfinite(value) and value > 0):
                raise ConfigurationError(flag, f'{value:g}', 'give numbers above 0')
    given = {flag: values for flag, values in (lists | words).items() if values is not None}
    others = {'--corners': told.corners, '--sides-mm': told.sides_mm, '--height-mm': single}
    if not told.diameter_px:
        for flag, values in {**given, **others}.items():
            if values:
                raise ConfigurationError(
                    flag, 'needs --diameter-px', 'add the diameter of a bead in the picture'
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
