"""The sample cells and their beads ([B19] table 1), checked when loaded."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from importlib import resources
from typing import TYPE_CHECKING, Any

import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.film_section import SECTION
from nanorocks_ros.experiment.materials import (
    GRAM_PER_CUBIC_CENTIMETRE,
    Material,
    MaterialReader,
    known_materials,
    paste_remedy,
)
from nanorocks_ros.experiment.yaml_lines import (
    YamlLines,
    file_content,
    parse_yaml,
    shown_name,
)

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

MILLIMETRE = 1e-3
GRAM = 1e-3


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
    """

    properties: Material
    diameter_low: float
    diameter_high: float
    count: int
    mass: float | None = None
    counted: bool = True

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
        Inner length, width and height; the camera looks along the height.
    species : tuple of Species
    chalk : bool
        Whether the beads were breaded with chalk dust.
    place : tuple of 2 floats or None, [m]
        Corner of the cell nearest to the upper left one of the plate, along columns and rows of
        the picture; None for a cell that lies on no plate.
    """

    number: int
    dimensions: tuple[float, float, float]
    species: tuple[Species, ...]
    chalk: bool
    place: tuple[float, float] | None = None

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


def load_trays(path: str | Path | None = None) -> dict[int, Tray]:
    """The trays of a YAML file, by number; by default those that were flown.

    Parameters
    ----------
    path : str or Path, optional
        Of the file; or, with a line break in it, its content, as a recording keeps it.

    Raises
    ------
    ConfigurationError
        When the file cannot be read or an entry cannot be used; names the line.
    """
    if path is None or str(path) == '':
        name = 'trays.yaml'
        text = resources.files(__package__).joinpath(name).read_text(encoding='utf-8')
    else:
        name = shown_name(path, 'trays file')
        text = file_content(path, 'a readable YAML file of trays')
    return _TrayFile(name).trays(parse_yaml(name, text))


def tray_values(tray: Tray) -> dict[str, Any]:
    """A tray as plain values for JSON; properties only of materials that its file describes."""
    return asdict(tray) | {'species': [_species_values(species) for species in tray.species]}


def _species_values(species: Species) -> dict[str, Any]:
    values = {
        'material': species.material,
        'diameter_low': species.diameter_low,
        'diameter_high': species.diameter_high,
        'density': species.density,
        'count': species.count,
        'mass': species.mass,
    }
    known = known_materials().get(species.material)
    if known is None or species.properties != replace(known, density=species.density):
        values['properties'] = asdict(species.properties)
    return values


def tray_by_number(trays: Mapping[int, Tray], number: int) -> Tray:
    """One tray of those loaded.

    Raises
    ------
    ConfigurationError
        When there is no tray of that number.
    """
    if number not in trays:
        known = ', '.join(str(tray) for tray in sorted(trays))
        raise ConfigurationError(f'tray {number}', 'does not exist', f'choose one of {known}')
    return trays[number]


class _TrayFile(YamlLines):
    """Trays from the nodes of a file."""

    def trays(self, root: yaml.Node | None) -> dict[int, Tray]:
        if root is None:
            raise self.error(None, 'is empty', 'describe at least one tray under "trays:"')
        top = self.mapping(root, {'trays'}, {'densities_g_cm3', 'materials', SECTION})
        self._read_materials(top)
        trays = {}
        for key, node in self.pairs(top['trays']):
            number = self._tray_number(key, node)
            trays[number] = self._tray(number, node)
        if not trays:
            raise self.error(top['trays'], 'lists no tray', 'add at least one')
        return trays

    def _read_materials(self, top: Mapping[str, yaml.Node]) -> None:
        """Materials of the package with the densities of the file, and those it describes."""
        densities = {}
        if 'densities_g_cm3' in top:
            pairs = self.pairs(top['densities_g_cm3'])
            densities = {str(key): self.positive(value) for key, value in pairs}
        self._densities = densities
        self._materials = {
            name: replace(material, density=densities[name] * GRAM_PER_CUBIC_CENTIMETRE)
            if name in densities
            else material
            for name, material in known_materials().items()
        }
        if 'materials' in top:
            reader = MaterialReader(self.file, densities)
            self._materials |= reader.materials(top['materials'])

    def _material(self, node: yaml.Node) -> Material:
        name = str(self.scalar(node))
        if name not in self._materials:
            known = ', '.join(sorted(self._materials))
            raise self.error(
                node,
                f'material {name!r} is not described (known: {known})',
                paste_remedy(name, density_given=name in self._densities),
            )
        return self._materials[name]

    def _tray_number(self, key: object, node: yaml.Node) -> int:
        if isinstance(key, bool) or not isinstance(key, int) or key < 1:
            raise self.error(node, f'tray number {key!r}', 'number the trays 1, 2, ...')
        return key

    def _tray(self, number: int, node: yaml.Node) -> Tray:
        entry = self.mapping(node, {'dimensions_mm', 'species'}, {'chalk', 'place_mm'})
        sides = self._lengths(entry['dimensions_mm'])
        if len(sides) != 3:
            raise self.error(
                entry['dimensions_mm'], f'{len(sides)} dimensions', 'give length, width, height'
            )
        if not isinstance(entry['species'], yaml.SequenceNode) or not entry['species'].value:
            raise self.error(entry['species'], 'species is no list', 'list at least one')
        nodes = entry['species'].value
        species = tuple(self._species(item) for item in nodes)
        for item, beads in zip(nodes, species, strict=True):
            if beads.diameter_high > min(sides) * MILLIMETRE * (1.0 + 1e-12):
                raise self.error(
                    item,
                    f'beads of {beads.diameter_high / MILLIMETRE:g} mm in a tray of '
                    f'{min(sides):g} mm',
                    'correct the diameter or the dimensions',
                )
        return Tray(
            number=number,
            dimensions=(sides[0] * MILLIMETRE, sides[1] * MILLIMETRE, sides[2] * MILLIMETRE),
            species=species,
            chalk=self._flag(entry.get('chalk')),
            place=self._place(entry.get('place_mm')),
        )

    def _place(self, node: yaml.Node | None) -> tuple[float, float] | None:
        if node is None:
            return None
        place = [self.number(item) for item in self.listed(node)]
        if len(place) != 2 or min(place) < 0.0:
            raise self.error(node, f'a place of {place}', 'give column and row, 0 or more')
        return place[0] * MILLIMETRE, place[1] * MILLIMETRE

    def _species(self, node: yaml.Node) -> Species:
        entry = self.mapping(node, {'material', 'diameter_mm', 'count'}, {'mass_g'})
        material = self._material(entry['material'])
        diameters = self._lengths(entry['diameter_mm'])
        if len(diameters) not in (1, 2) or diameters[0] > diameters[-1]:
            raise self.error(
                entry['diameter_mm'], f'diameter {diameters}', 'give one, or the lower and upper'
            )
        mass = entry.get('mass_g')
        return Species(
            diameter_low=diameters[0] * MILLIMETRE,
            diameter_high=diameters[-1] * MILLIMETRE,
            count=self._count(entry['count']),
            mass=None if mass is None else self.positive(mass) * GRAM,
            properties=material,
        )

    def _lengths(self, node: yaml.Node) -> list[float]:
        return [self.positive(item) for item in self.listed(node)]

    def _count(self, node: yaml.Node) -> int:
        value = self.positive(node)
        if not value.is_integer():
            raise self.error(node, f'count {value:g} is no whole number', 'correct it')
        return int(value)

    def _flag(self, node: yaml.Node | None) -> bool:
        if node is None:
            return False
        value = self.scalar(node)
        if not isinstance(value, bool):
            raise self.error(node, f'chalk is {value!r}', 'say true or false')
        return value
