"""The sample cells and their beads ([B19] table 1).

Tested by ``test/experiment/test_trays.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nanorocks_ros.experiment.appearance import Appearance
    from nanorocks_ros.experiment.materials import Material

Polygon = tuple[tuple[float, float], ...]
"""Corners of a part of the picture, [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Species:
    """Beads of one material in one tray.

    Parameters
    ----------
    properties : Material
        What the beads are made of.
    diameter_low, diameter_high : float, [m]
        Ends of the range of diameters; equal when all beads are alike.
    count : int
        Of the beads; where `counted` is False the largest number that may be there.
    mass : float or None, [kg]
        Total mass, where the paper gives that instead of a count.
    counted : bool
        Whether the number of beads is known.
    appearance : Appearance or None
        What is told of their look in a film that is learnt; None: beads of the flight, which are
        told from the floor by the colours of their materials.
    """

    properties: Material
    diameter_low: float
    diameter_high: float
    count: int
    mass: float | None = None
    counted: bool = True
    appearance: Appearance | None = None

    @property
    def material(self) -> str:
        """Name of the material."""
        return self.properties.name

    @property
    def expected(self) -> int | None:
        """Number of beads; None where it is not known."""
        return self.count if self.counted else None

    @property
    def density(self) -> float:
        """Density of the material, [kg/m^3]."""
        return self.properties.density

    @property
    def diameter(self) -> float:
        """Middle of the range of diameters, [m]."""
        return 0.5 * (self.diameter_low + self.diameter_high)

    @property
    def bead_mass(self) -> float:
        """Mass of a bead of the middle diameter, [kg]."""
        return self.density * math.pi / 6.0 * self.diameter**3

    @property
    def count_from_mass(self) -> float | None:
        """Number of beads of the middle diameter that weigh `mass`."""
        return None if self.mass is None else self.mass / self.bead_mass


@dataclass(frozen=True, slots=True, kw_only=True)
class Tray:
    """One sample cell.

    Parameters
    ----------
    number : int
    dimensions : tuple of 3 floats, [m]
        Inner length, width and height; the camera looks along the height, which may be NaN where
        it is not known.
    species : tuple of Species
    chalk : bool
        Whether the beads were breaded with chalk dust.
    place : tuple of 2 floats or None, [m]
        Corner of the cell nearest to the upper left one of the plate, along columns and rows of
        the picture; None for a cell that lies on no plate.
    inside : tuple of places or None, [m]
        Corners of the part of the picture in which beads are searched; None: everywhere.
    masks : tuple of tuples of places, [m]
        Corners of parts in which they are not.
    """

    number: int
    dimensions: tuple[float, float, float]
    species: tuple[Species, ...]
    chalk: bool
    place: tuple[float, float] | None = None
    inside: Polygon | None = None
    masks: tuple[Polygon, ...] = ()

    @property
    def is_learnt(self) -> bool:
        """Whether the look of its beads is learnt from the film."""
        return any(species.appearance is not None for species in self.species)

    @property
    def count(self) -> int:
        """Number of beads of all species."""
        return sum(species.count for species in self.species)

    @property
    def materials(self) -> dict[str, Material]:
        """Materials of the beads, by name."""
        return {species.material: species.properties for species in self.species}

    @property
    def volume(self) -> float:
        """Inner volume, [m^3]."""
        return math.prod(self.dimensions)

    @property
    def number_density(self) -> float:
        """Beads per volume, [1/m^3]."""
        return self.count / self.volume

    @property
    def diameter(self) -> float:
        """Mean bead diameter over all beads, [m]."""
        return sum(species.count * species.diameter for species in self.species) / self.count

    @property
    def mean_mass(self) -> float:
        """Mean mass of a bead, [kg]."""
        return sum(species.count * species.bead_mass for species in self.species) / self.count
