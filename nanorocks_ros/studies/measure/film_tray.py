"""A trays file from the little that is known of a film: diameters in pixels, sides, counts.

What is not told is guessed, and a notice says what was guessed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import FilmSection
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

# A bead of unknown size counts as one of the flight: the constants of the stages suit it.
_NOMINAL_DIAMETER = 2e-3
# Largest path of a bead between two pictures, in diameters, where nothing is told.
_MAX_STEP = 2.0
# Share of the tray that beads side by side may cover, and their number, in each round of counting:
# the threshold of recognition follows from what is expected.
_ROUNDS = (0.02, 0.1, 0.5)
_MAX_BEADS = 2000
# Counted beads over the most that may be counted, above which a round is repeated with more.
_NEARLY_ALL = 0.7
# Largest difference of the scales along both sides, relative.
_MAX_SKEW = 0.03
_MM = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmedBeads:
    """A species of beads, as the user describes it.

    Parameters
    ----------
    diameter_px : float, [px]
    diameter : float or None, [m]
    count : int or None
    density : float or None, [g/cm^3]
    color_bgr : tuple of 3 floats
        Of the beads, [gray levels].
    """

    diameter_px: float
    diameter: float | None = None
    count: int | None = None
    density: float | None = None
    color_bgr: tuple[float, float, float] = (90.0, 90.0, 90.0)


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
        Along the line of sight.
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


def described_tray(
    filmed: FilmedTray, frames: Sequence[NDArray[np.uint8]], rate: float
) -> DescribedTray:
    """The trays file of a film.

    Parameters
    ----------
    filmed : FilmedTray
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
        Some frames of the film, on which beads are counted where nobody did.
    rate : float, [1/s]
        Frames per second.

    Raises
    ------
    ConfigurationError
        For numbers that do not fit each other or the picture.
    """
    if not filmed.beads:
        raise ConfigurationError('--diameter-px', 'is needed', 'measure a bead in the picture')
    height, width = frames[0].shape[:2]
    region = _region(filmed.corners_px, (width, height))
    scale, scale_notice = _scale(filmed, region)
    notices = [scale_notice] if scale_notice else []
    largest = max(beads.diameter_px for beads in filmed.beads) / scale
    if filmed.height is None:
        notices.append(
            f'the height of the container is not told; one layer of beads is assumed, '
            f'{_MM * largest:.3g} mm; --height-mm sets it'
        )
    known = filmed.sides is not None and filmed.height is not None
    section = FilmSection(
        pixels_per_metre=scale,
        region_px=region,
        scale_known=_is_scale_known(filmed),
        container_known=known and bool(filmed.corners_px),
        max_speed=_MAX_STEP * largest * rate,
    )
    sides = (region[2] / scale, region[3] / scale, max(filmed.height or 0.0, largest))
    if known:
        assert filmed.sides is not None
        sides = (*filmed.sides, sides[2])
    guessed = filmed
    for share in _ROUNDS:
        if all(beads.count is not None for beads in filmed.beads):
            break
        most = tuple(_most_beads(beads, region, share) for beads in filmed.beads)
        counts = counted_beads(_text(_with_counts(filmed, most), section, sides), section, frames)
        guessed = _with_counts(filmed, counts)
        if all(count < _NEARLY_ALL * limit for count, limit in zip(counts, most, strict=True)):
            break
    if guessed != filmed:
        told = ' and '.join(str(beads.count) for beads in guessed.beads)
        notices.append(f'the number of beads is not told; {told} are seen; --count sets it')
    return DescribedTray(text=_text(guessed, section, sides), notices=tuple(notices))


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
        'no length is told: results are in px; --diameter-mm gives them in mm'
    )


def _most_beads(beads: FilmedBeads, region: tuple[int, int, int, int], share: float) -> int:
    """The number of beads that cover a share of the tray."""
    room = share * region[2] * region[3] / (0.25 * math.pi * beads.diameter_px**2)
    return max(3, min(int(room), _MAX_BEADS))


def _with_counts(filmed: FilmedTray, counts: tuple[int, ...]) -> FilmedTray:
    beads = tuple(
        told if told.count is not None else replace(told, count=count)
        for told, count in zip(filmed.beads, counts, strict=True)
    )
    return replace(filmed, beads=beads)


def counted_beads(
    text: str, section: FilmSection, frames: Sequence[NDArray[np.uint8]]
) -> tuple[int, ...]:
    """The number of beads of each species: the median of those seen in some frames, at least 1.

    Parameters
    ----------
    text : str
        Of a trays file, with at least as many beads.
    section : FilmSection
    frames : sequence of ndarray of uint8, (rows, columns, 3), bgr
    """
    (tray,) = load_trays(text).values()
    column, row, width, height = section.region_px
    detector = BeadDetector(PipelineSettings().tracking, tray, section.pixels_per_metre)
    seen = [
        [
            beads.radii.size
            for beads in detector.detect(frame[row : row + height, column : column + width])
        ]
        for frame in frames
    ]
    medians = np.median(np.array(seen), axis=0)
    return tuple(max(1, round(float(median))) for median in medians)


def _text(filmed: FilmedTray, section: FilmSection, sides: tuple[float, float, float]) -> str:
    """The trays file."""
    materials, species = [], []
    for number, beads in enumerate(filmed.beads, start=1):
        name = f'beads_{number}' if len(filmed.beads) > 1 else 'beads'
        color = ', '.join(f'{level:g}' for level in beads.color_bgr)
        density = 1.0 if beads.density is None else beads.density
        materials.append(f'  {name}: {{density_g_cm3: {density:g}, color_bgr: [{color}]}}\n')
        diameter = beads.diameter or beads.diameter_px / section.pixels_per_metre
        species.append(
            f'      - {{material: {name}, diameter_mm: {_MM * diameter:.6g}, '
            f'count: {beads.count}}}\n'
        )
    lengths = ', '.join(f'{_MM * side:.6g}' for side in sides)
    return (
        f'# Lengths in mm, places in px of the film.\n{section.text()}'
        f'materials:\n{"".join(materials)}'
        f'trays:\n  1:\n    dimensions_mm: [{lengths}]\n    species:\n{"".join(species)}'
    )
