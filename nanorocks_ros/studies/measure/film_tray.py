"""A trays file from the little that is known of a film: diameters in pixels, sides, counts.

What is not told is guessed, and a notice says what was guessed.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO, COLOUR_FORMS, LOOKS, is_colour
from nanorocks_ros.experiment.film_section import FilmSection
from nanorocks_ros.experiment.oblique_view import MAX_STRETCH, Perspective, clockwise

if TYPE_CHECKING:
    from collections.abc import Sequence

# A bead of unknown size counts as one of the flight: the constants of the stages suit it.
_NOMINAL_DIAMETER = 2e-3
# Largest difference of the scales along both sides, and of a corner from that of a rectangle over
# the shorter side.
_MAX_SKEW = 0.03
_MM = 1e3
_NAME = re.compile(r'[A-Za-z][\w-]{0,39}')


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedBeads:
    """A species of beads, as the user describes it.

    Parameters
    ----------
    diameter_px : float, [px]
        NaN: to be found in the film.
    diameter : float or None, [m]
    count : int or None
    density : float or None, [g/cm^3]
    look, colour : str
        As ``look:`` and ``colour:`` of a trays file.
    material : str
        Its name; empty: ``beads``, with a number where there are several species.
    """

    diameter_px: float
    diameter: float | None = None
    count: int | None = None
    density: float | None = None
    look: str = AUTO
    colour: str = AUTO
    material: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedTray:
    """What the user says of a film.

    Parameters
    ----------
    beads : tuple of FilmedBeads
    corners_px : tuple of (float, float), [px]
        Column and row of the corners of the container; empty: the whole picture.
    sides : tuple of 2 floats or None, [m]
        Inner length and width of the container, along columns and rows.
    height : float or None, [m]
        Along the line of sight; None: any.
    """

    beads: tuple[FilmedBeads, ...]
    corners_px: tuple[tuple[float, float], ...] = ()
    sides: tuple[float, float] | None = None
    height: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedTray:
    """A trays file, and what was guessed for it.

    Parameters
    ----------
    text : str
        YAML, with a section ``film``.
    notices : tuple of str
    """

    text: str
    notices: tuple[str, ...]


def described_tray(filmed: FilmedTray, size: tuple[int, int]) -> DescribedTray:
    """The trays file of a film.

    Parameters
    ----------
    filmed : FilmedTray
    size : tuple of 2 ints, [px]
        Width and height of the picture.

    Raises
    ------
    ConfigurationError
        For numbers that do not fit each other or the picture.
    """
    if not filmed.beads:
        raise ConfigurationError('--diameter-px', 'is needed', 'measure a bead in the picture')
    oblique = _perspective(filmed, size)
    region = _region(filmed.corners_px, size) if oblique is None else (0, 0, *oblique.size_px)
    _check_beads(filmed.beads, region)
    scale, scale_notice = _scale(filmed, region)
    largest = max(beads.diameter or beads.diameter_px / scale for beads in filmed.beads)
    known = filmed.sides is not None and filmed.height is not None
    section = FilmSection(
        pixels_per_metre=scale,
        region_px=region,
        scale_known=_is_scale_known(filmed),
        container_known=known and bool(filmed.corners_px),
        corners_px=() if oblique is None else oblique.corners_px,
        picture_px=size,
    )
    sides = [region[2] / scale, region[3] / scale]
    if known:
        assert filmed.sides is not None
        sides = [*filmed.sides]
    if filmed.height is not None:
        sides.append(max(filmed.height, largest))
    notices = [scale_notice, *_guesses(filmed)]
    if oblique is not None:
        notices.append(
            f'the container is seen at an angle, scales differ by {oblique.stretch - 1.0:.0%}; '
            'its floor is rectified, and what is higher is seen displaced'
        )
    return DescribedTray(
        text=_text(filmed, section, sides),
        notices=tuple(notice for notice in notices if notice),
    )


def _check_beads(species: Sequence[FilmedBeads], region: tuple[int, int, int, int]) -> None:
    """Refuse beads that the trays file could not describe, by the names of their options."""
    width, height = region[2:]
    for beads in species:
        if beads.look not in LOOKS:
            problem = f'unknown look {beads.look!r}'
            raise ConfigurationError('--look', problem, f'use {", ".join(LOOKS)}')
        if not is_colour(beads.colour):
            problem = f'unknown colour {beads.colour!r}'
            raise ConfigurationError('--colour', problem, f'use {COLOUR_FORMS}')
        if beads.diameter_px > min(width, height):
            raise ConfigurationError(
                '--diameter-px',
                f'{beads.diameter_px:g} px do not fit into the container of {width}x{height} px',
                'give the diameter of one bead in px of the film',
            )


def _guesses(filmed: FilmedTray) -> list[str]:
    """What is assumed beside the scale, a line each."""
    notices = []
    if filmed.sides is not None and not filmed.corners_px:
        notices.append('the sides of the container are of no use without --corners')
    if filmed.height is None:
        remedy = '--height-mm' if _is_scale_known(filmed) else '--height-mm with --diameter-mm'
        notices.append(
            'the height of the container is not given; how far collisions are tilted out of the '
            f'picture follows from the distances of the beads; {remedy} gives it (for a single '
            'layer the diameter)'
        )
    if len(filmed.beads) > 1 and any(beads.density is None for beads in filmed.beads):
        notices.append(
            'collisions of different beads need their densities; all are taken as alike; '
            '--density-g-cm3 sets them'
        )
    return notices


def _is_scale_known(filmed: FilmedTray) -> bool:
    by_sides = filmed.sides is not None and bool(filmed.corners_px)
    return by_sides or any(beads.diameter is not None for beads in filmed.beads)


def _region(
    corners: tuple[tuple[float, float], ...], size: tuple[int, int]
) -> tuple[int, int, int, int]:
    """The rectangle of the corners, or the whole picture."""
    if not corners:
        return 0, 0, *size
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    column, row, right, bottom = (round(float(value)) for value in (*low, *high))
    if column < 0 or row < 0 or right > size[0] or bottom > size[1]:
        raise ConfigurationError(
            '--corners',
            f'{column} {row} to {right} {bottom} lie outside the picture of {size[0]}x{size[1]}',
            'give columns and rows in px of the film',
        )
    if right - column < 16 or bottom - row < 16:
        raise ConfigurationError(
            '--corners', f'are {right - column}x{bottom - row} px apart', 'give opposite corners'
        )
    return column, row, right - column, bottom - row


def _perspective(filmed: FilmedTray, size: tuple[int, int]) -> Perspective | None:
    """How four corners are seen at an angle; None for others, and for an upright rectangle."""
    corners = filmed.corners_px
    if len(corners) != 4:
        return None
    _region(corners, size)
    (left, top), (right, bottom) = np.min(corners, axis=0), np.max(corners, axis=0)
    upright = (left, top), (right, top), (right, bottom), (left, bottom)
    off = max(min(math.dist(corner, told) for told in corners) for corner in upright)
    if off <= _MAX_SKEW * min(right - left, bottom - top):
        return None
    points = np.array(clockwise(corners))
    following = np.roll(points, -1, axis=0)
    along, down, back, up = np.hypot(*(following - points).T).tolist()
    x, y = points.T
    area = 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    if filmed.sides is not None:
        ratio = filmed.sides[0] / filmed.sides[1]
    else:
        # A rectangle that is turned in the picture: its sides are right as they are seen.
        ratio = (along + back) / (down + up)
        diagonals = math.dist(points[0], points[2]) / math.dist(points[1], points[3])
        if max(abs(along / back - 1.0), abs(down / up - 1.0), abs(diagonals - 1.0)) > _MAX_SKEW:
            raise ConfigurationError(
                '--corners',
                f'form no upright rectangle: one is {off:.0f} px off, and its sides are not given',
                'add --sides-mm LENGTH WIDTH, film straight from above, or calibrate the camera '
                '(`nanorocks calibrate`); two opposite corners take the box around the container '
                'as it is',
            )
    width, height = math.sqrt(area * ratio), math.sqrt(area / ratio)
    perspective = Perspective(clockwise(corners), (round(width), round(height)))
    if perspective.stretch > MAX_STRETCH:
        raise ConfigurationError(
            '--corners',
            f'scales differ by {perspective.stretch - 1.0:.0%} over the container, more than '
            f'{MAX_STRETCH - 1.0:.0%}',
            'film it from straight above, or correct --sides-mm and --corners',
        )
    return perspective


def _scale(filmed: FilmedTray, region: tuple[int, int, int, int]) -> tuple[float, str]:
    """Pixels per metre, and a notice where it is guessed or contradicted."""
    by_beads = [
        beads.diameter_px / beads.diameter for beads in filmed.beads if beads.diameter is not None
    ]
    if filmed.sides is not None and filmed.corners_px:
        along, across = region[2] / filmed.sides[0], region[3] / filmed.sides[1]
        if abs(along / across - 1.0) > _MAX_SKEW:
            raise ConfigurationError(
                '--sides-mm',
                f'give {along:.0f} px/m along columns and {across:.0f} px/m along rows',
                'give the length along columns first, and the corners of the inside',
            )
        return math.sqrt(along * across), ''
    if by_beads:
        return float(np.mean(by_beads)), ''
    return filmed.beads[0].diameter_px / _NOMINAL_DIAMETER, (
        'no length is given: results are in px; --diameter-mm gives them in mm'
    )


def _names(species: Sequence[FilmedBeads]) -> list[str]:
    """Names of the materials in the trays file.

    Raises
    ------
    ConfigurationError
        For a name that is no word, or that two species have.
    """
    several = len(species) > 1
    names = [
        beads.material or (f'beads_{number}' if several else 'beads')
        for number, beads in enumerate(species, start=1)
    ]
    for name in names:
        if not _NAME.fullmatch(name):
            raise ConfigurationError(
                '--material',
                f'{name[:60]!r} is no name',
                'give letters, digits, _ and -, up to 40',
            )
        if names.count(name) > 1:
            raise ConfigurationError('--material', f'{name} is named twice', 'name them apart')
    return names


def _text(filmed: FilmedTray, section: FilmSection, sides: Sequence[float]) -> str:
    """The trays file."""
    materials, species = [], []
    for name, beads in zip(_names(filmed.beads), filmed.beads, strict=True):
        density = 1.0 if beads.density is None else beads.density
        materials.append(f'  {name}: {{density_g_cm3: {density:g}, color_bgr: [90, 90, 90]}}\n')
        count = '' if beads.count is None else f', count: {beads.count}'
        diameter = beads.diameter or beads.diameter_px / section.pixels_per_metre
        species.append(
            f'      - {{material: {name}, diameter_mm: {_MM * diameter:.6g}{count}, '
            f'look: {beads.look}, colour: "{beads.colour}"}}\n'
        )
    lengths = ', '.join(f'{_MM * side:.6g}' for side in sides)
    return (
        f'# Lengths in mm, places in px of the film.\n{section.text()}'
        f'materials:\n{"".join(materials)}'
        f'trays:\n  1:\n    dimensions_mm: [{lengths}]\n    species:\n{"".join(species)}'
    )
