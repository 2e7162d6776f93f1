"""The trays of a file, checked when loaded; by default those of the flight ([B19] table 1)."""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from importlib import resources
from typing import TYPE_CHECKING, Any

import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.appearance import AUTO, Appearance, read_appearance
from nanorocks_ros.experiment.materials import (
    GRAM_PER_CUBIC_CENTIMETRE,
    Look,
    Material,
    MaterialReader,
    known_materials,
    paste_remedy,
)
from nanorocks_ros.experiment.tray_cells import Polygon
from nanorocks_ros.experiment.tray_cells import Species as Species
from nanorocks_ros.experiment.tray_cells import Tray as Tray
from nanorocks_ros.experiment.unknown_diameters import DIAMETER, finding_diameters
from nanorocks_ros.experiment.yaml_lines import (
    YamlLines,
    file_content,
    parse_yaml,
    shown_name,
)
from nanorocks_ros.limits import BEADS

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

FILM_SECTION = 'film'
"""Name of the section of a trays file that says where the tray is in its film."""

MILLIMETRE = 1e-3
# Beads of a species that is not counted: what fits side by side, and not more than these.
_MAX_UNCOUNTED = 2000
_UNKNOWN_COLOR = 90.0, 90.0, 90.0
GRAM = 1e-3


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
    is_flight = path is None or str(path) == ''
    name = 'trays.yaml' if is_flight else shown_name(str(path), 'trays file')
    return _TrayFile(name).trays(parse_yaml(name, trays_text(path)))


def trays_text(path: str | Path | None = None) -> str:
    """The content of a file of trays, as of `load_trays`."""
    if path is None or str(path) == '':
        return resources.files(__package__).joinpath('trays.yaml').read_text(encoding='utf-8')
    return file_content(path, 'a readable YAML file of trays')


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
    if not species.counted:
        values['counted'] = False
    if species.appearance is not None:
        values['appearance'] = asdict(species.appearance)
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


def require_measurable(tray: Tray) -> None:
    """Check that restitutions can be measured in a tray, not only beads followed.

    Raises
    ------
    ConfigurationError
        When its height, or count or density of a species, is not known.
    """
    missing = ['height (third of dimensions_mm)'] * math.isnan(tray.dimensions[2])
    for species in tray.species:
        missing += [f'count of {species.material}'] * (not species.counted)
        missing += [f'density of {species.material}'] * math.isnan(species.density)
    if missing:
        raise ConfigurationError(
            f'tray {tray.number}',
            f'the trays file does not tell {", ".join(missing)}',
            'add it (a density under "densities_g_cm3:"), or measure contacts alone: '
            '`nanorocks measure FILM`',
        )


class _TrayFile(YamlLines):
    """Trays from the nodes of a file."""

    def trays(self, root: yaml.Node | None) -> dict[int, Tray]:
        if root is None:
            raise self.error(None, 'is empty', 'describe at least one tray under "trays:"')
        top = self.mapping(root, {'trays'}, {'densities_g_cm3', 'materials', FILM_SECTION})
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
        entry = self.mapping(
            node, {'dimensions_mm', 'species'}, {'chalk', 'place_mm', 'inside_mm', 'masks_mm'}
        )
        sides = self._lengths(entry['dimensions_mm'])
        if not isinstance(entry['species'], yaml.SequenceNode) or not entry['species'].value:
            raise self.error(entry['species'], 'species is no list', 'list at least one')
        nodes = entry['species'].value
        species = tuple(self._species(item, sides) for item in nodes)
        for item, beads in zip(nodes, species, strict=True):
            if beads.diameter_high > min(sides) * MILLIMETRE * (1.0 + 1e-12):
                raise self.error(
                    item,
                    f'beads of {beads.diameter_high / MILLIMETRE:g} mm in a tray of '
                    f'{min(sides):g} mm',
                    'correct the diameter or the dimensions',
                )
        # Following beads that are learnt from the film needs no height.
        flat = len(sides) == 2 and all(beads.appearance is not None for beads in species)
        if len(sides) != 3 and not flat:
            raise self.error(
                entry['dimensions_mm'], f'{len(sides)} dimensions', 'give length, width, height'
            )
        return Tray(
            number=number,
            dimensions=(
                sides[0] * MILLIMETRE,
                sides[1] * MILLIMETRE,
                sides[2] * MILLIMETRE if len(sides) == 3 else math.nan,
            ),
            species=species,
            chalk=self._flag(entry.get('chalk')),
            place=self._place(entry.get('place_mm')),
            inside=self._polygon(entry['inside_mm']) if 'inside_mm' in entry else None,
            masks=self._masks(entry.get('masks_mm')),
        )

    def _masks(self, node: yaml.Node | None) -> tuple[Polygon, ...]:
        return () if node is None else tuple(self._polygon(item) for item in self.listed(node))

    def _polygon(self, node: yaml.Node) -> Polygon:
        corners = [
            [self.number(item) for item in self.listed(corner)] for corner in self.listed(node)
        ]
        if len(corners) < 3 or any(len(corner) != 2 for corner in corners):
            raise self.error(
                node, 'is no polygon', 'give three corners or more: [[0, 0], [5, 0], [5, 2]]'
            )
        return tuple((x * MILLIMETRE, y * MILLIMETRE) for x, y in corners)

    def _place(self, node: yaml.Node | None) -> tuple[float, float] | None:
        if node is None:
            return None
        place = [self.number(item) for item in self.listed(node)]
        if len(place) != 2 or min(place) < 0.0:
            raise self.error(node, f'a place of {place}', 'give column and row, 0 or more')
        return place[0] * MILLIMETRE, place[1] * MILLIMETRE

    def _species(self, node: yaml.Node, sides: list[float]) -> Species:
        entry = self.mapping(
            node, set(), {DIAMETER, 'material', 'count', 'mass_g', 'look', 'colour'}
        )
        appearance = read_appearance(self, entry.get('look'), entry.get('colour'))
        material, appearance = self._material_of(node, entry.get('material'), appearance)
        if 'count' not in entry and appearance is None:
            raise self.error(node, 'lacks count', 'add it, or "look: auto" to find any number')
        diameters = self._diameters(node, entry.get(DIAMETER))
        mass = entry.get('mass_g')
        fitting = min(_MAX_UNCOUNTED, max(1, int(math.prod(sides[:2]) / diameters[0] ** 2)))
        return Species(
            diameter_low=diameters[0] * MILLIMETRE,
            diameter_high=diameters[-1] * MILLIMETRE,
            count=self._count(entry['count']) if 'count' in entry else fitting,
            mass=None if mass is None else self.positive(mass) * GRAM,
            properties=material,
            counted='count' in entry,
            appearance=appearance,
        )

    def _diameters(self, node: yaml.Node, told: yaml.Node | None) -> list[float]:
        if told is None or (isinstance(told, yaml.ScalarNode) and told.value == AUTO):
            raise self.error(node, f'lacks {DIAMETER}', f'add it; {finding_diameters(self.file)}')
        diameters = self._lengths(told)
        if len(diameters) not in (1, 2) or diameters[0] > diameters[-1]:
            raise self.error(told, f'diameter {diameters}', 'give one, or the lower and upper')
        return diameters

    def _material_of(
        self, node: yaml.Node, name: yaml.Node | None, appearance: Appearance | None
    ) -> tuple[Material, Appearance | None]:
        """The material of a species, described or not, and its look.

        Materials of the flight have the look of the flight, unless it is told; others are learnt.
        """
        if name is None:
            if appearance is None:
                raise self.error(node, 'lacks material', 'add it, or "look: auto" for any beads')
            return self._undescribed('bead', appearance), appearance
        word = str(self.scalar(name))
        if appearance is not None and word not in self._materials:
            return self._undescribed(word, appearance), appearance
        material = self._material(name)
        flown = word in known_materials() and appearance is None
        return material, None if flown else appearance or Appearance()

    def _undescribed(self, name: str, appearance: Appearance) -> Material:
        """A material of which only the look is told."""
        told = appearance.colour or _UNKNOWN_COLOR
        density = self._densities.get(name, math.nan) * GRAM_PER_CUBIC_CENTIMETRE
        look = Look(blue=told[0], green=told[1], red=told[2])
        return Material(name=name, density=density, color=told, look=look)

    def _lengths(self, node: yaml.Node) -> list[float]:
        return [self.positive(item) for item in self.listed(node)]

    def _count(self, node: yaml.Node) -> int:
        value = self.positive(node)
        if not value.is_integer():
            raise self.error(node, f'count {value:g} is no whole number', 'correct it')
        if value > BEADS.value:
            above = BEADS.exceeded(int(value), ConfigurationError, '')
            raise self.error(node, above.what, above.do)
        return int(value)

    def _flag(self, node: yaml.Node | None) -> bool:
        if node is None:
            return False
        value = self.scalar(node)
        if not isinstance(value, bool):
            raise self.error(node, f'chalk is {value!r}', 'say true or false')
        return value
