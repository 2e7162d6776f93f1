"""The aluminium plate with the sample cells, seen from above."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.experiment.trays import Tray

# Sides of the plate, [m] ([B19] section 2: about 8 x 8 x 2 cm^3).
PLATE = 0.08, 0.08


class Region(NamedTuple):
    """A rectangle of the rectified picture, [px]."""

    x: int
    y: int
    width: int
    height: int


def regions_on_plate(
    trays: Iterable[Tray], shape: tuple[int, int], pixels_per_metre: float
) -> dict[int, Region]:
    """Regions of the floors of the trays, with the plate in the middle of the picture.

    Parameters
    ----------
    trays : iterable of Tray
    shape : tuple of 2 ints, [px]
        Rows and columns of the picture.
    pixels_per_metre : float, [px/m]

    Raises
    ------
    ConfigurationError
        For a tray that has no place on the plate, or lies outside the picture.
    """
    regions = {}
    for tray in trays:
        if tray.place is None:
            raise ConfigurationError(
                f'tray {tray.number}',
                'has no place on the plate',
                'add place_mm to the file of trays, or give its region in pixels',
            )
        corner = [
            0.5 * size + pixels_per_metre * (place - 0.5 * side)
            for size, place, side in zip(shape[::-1], tray.place, PLATE, strict=True)
        ]
        region = Region(
            round(corner[0]),
            round(corner[1]),
            round(tray.dimensions[0] * pixels_per_metre),
            round(tray.dimensions[1] * pixels_per_metre),
        )
        inside = region.x >= 0 and region.y >= 0
        if not inside or region.x + region.width > shape[1] or region.y + region.height > shape[0]:
            raise ConfigurationError(
                f'tray {tray.number}',
                f'lies outside a picture of {shape[1]} x {shape[0]} px at '
                f'{pixels_per_metre:g} px/m',
                'lower pixels_per_metre',
            )
        regions[tray.number] = region
    return regions
