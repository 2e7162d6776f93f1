"""Materials of beads: density, colour, shape, tracking error and look, from one file."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING

from nanorocks_ros.experiment.yaml_lines import YamlLines, parse_yaml

if TYPE_CHECKING:
    from collections.abc import Mapping

    import yaml

FILE = 'materials.yaml'
SHAPES = 'sphere', 'oval', 'grain'
GRAM_PER_CUBIC_CENTIMETRE = 1e3

# Difference of red and blue over their sum, above which a material counts as red or blue.
_HUE_THRESHOLD = 0.2
_OPTIONAL = {'shape', 'position_error_px', 'chalk_position_error_px', 'look'}


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Shading of a drawn sphere; all but the colour and the highlight are fractions.

    Parameters
    ----------
    blue, green, red : float, [gray levels]
        Colour where the light falls straight on.
    ambient, diffuse : float
        Light from everywhere, and from the lamp (Lambert).
    darkening : float
        Loss towards the outline.
    glow : float
        Light gathered inside a clear bead, on the side away from the lamp.
    sheen : float
        Broad reflection of the lamp in the colour of the bead, as of metal.
    highlight : float, [gray levels]
        Mirror image of the lamp.
    """

    blue: float
    green: float
    red: float
    ambient: float = 0.4
    diffuse: float = 0.6
    darkening: float = 0.45
    glow: float = 0.0
    sheen: float = 0.0
    highlight: float = 90.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """All that depends on the material of a bead.

    Parameters
    ----------
    name : str
    density : float, [kg/m^3]
    color : tuple of 3 floats, bgr, [gray levels]
        In even light.
    look : Look
    shape : str
        `sphere`; `oval`, a sphere that scenes draw as an ellipse; `grain`, with corners.
    position_error_px, chalk_position_error_px : float, [px]
        Systematic error of a tracked position, without and under chalk.
    """

    name: str
    density: float
    color: tuple[float, float, float]
    look: Look = field(repr=False)
    shape: str = 'sphere'
    position_error_px: float = 0.3
    chalk_position_error_px: float = 0.6

    @property
    def hue(self) -> int:
        """1 for a red material, -1 for a blue one, 0 for a gray one."""
        blue, _, red = self.color
        if red + blue == 0.0:
            return 0
        difference = (red - blue) / (red + blue)
        return int(difference > _HUE_THRESHOLD) - int(difference < -_HUE_THRESHOLD)


@cache
def known_materials() -> MappingProxyType[str, Material]:
    """The materials that come with the package, by name."""
    text = resources.files(__package__).joinpath(FILE).read_text(encoding='utf-8')
    return MappingProxyType(MaterialReader(FILE, {}).materials(parse_yaml(FILE, text)))


def paste_remedy(name: str, density_given: bool = False) -> str:
    """Describe how to add a material to a file of trays, as text that can be pasted."""
    density = '' if density_given else 'density_g_cm3: 1.0, '
    entry = f'{name}: {{{density}color_bgr: [90, 90, 90]}}'
    return f'add "materials: {{{entry}}}" with its values'


class MaterialReader(YamlLines):
    """Materials from the nodes of a YAML file.

    Parameters
    ----------
    file : str
        Name of the file, for errors.
    densities : mapping of str to float, [g/cm^3]
        Densities of materials that the file gives elsewhere.
    """

    def __init__(self, file: str, densities: Mapping[str, float]) -> None:
        super().__init__(file)
        self._densities = densities

    def materials(self, node: yaml.Node | None) -> dict[str, Material]:
        """Materials by name.

        Raises
        ------
        ConfigurationError
            When an entry cannot be used; names the line.
        """
        return {str(key): self._material(str(key), value) for key, value in self.pairs(node)}

    def _material(self, name: str, node: yaml.Node) -> Material:
        entry = self.mapping(node, {'color_bgr'}, {'density_g_cm3', *_OPTIONAL})
        color = self._color(entry['color_bgr'])
        errors = {
            key: self.positive(entry[key])
            for key in ('position_error_px', 'chalk_position_error_px')
            if key in entry
        }
        return Material(
            name=name,
            density=self._density(name, node, entry.get('density_g_cm3')),
            color=color,
            shape=self._shape(entry.get('shape')),
            look=self._look(entry.get('look'), color),
            **errors,
        )

    def _density(self, name: str, node: yaml.Node, density: yaml.Node | None) -> float:
        elsewhere = self._densities.get(name)
        if density is None and elsewhere is None:
            raise self.error(node, f'{name!r} has no density', 'add density_g_cm3')
        if density is not None and elsewhere is not None:
            raise self.error(
                density,
                f'the density of {name!r} is given twice',
                'remove it here or from densities_g_cm3',
            )
        value = elsewhere if density is None else self.positive(density)
        assert value is not None
        return value * GRAM_PER_CUBIC_CENTIMETRE

    def _color(self, node: yaml.Node) -> tuple[float, float, float]:
        levels = [self.number(item) for item in self.listed(node)]
        if len(levels) != 3 or min(levels) < 0.0 or max(levels) > 255.0:
            raise self.error(node, f'color {levels}', 'give blue, green and red, 0 to 255')
        return levels[0], levels[1], levels[2]

    def _shape(self, node: yaml.Node | None) -> str:
        if node is None:
            return SHAPES[0]
        shape = str(self.scalar(node))
        if shape not in SHAPES:
            raise self.error(node, f'unknown shape {shape!r}', f'use {", ".join(SHAPES)}')
        return shape

    def _look(self, node: yaml.Node | None, color: tuple[float, float, float]) -> Look:
        shading = {}
        if node is not None:
            names = {row.name for row in fields(Look)} - {'blue', 'green', 'red'}
            entry = self.mapping(node, set(), names | {'color_bgr'})
            if 'color_bgr' in entry:
                color = self._color(entry.pop('color_bgr'))
            shading = {name: self._fraction(name, value) for name, value in entry.items()}
        return Look(blue=color[0], green=color[1], red=color[2], **shading)

    def _fraction(self, name: str, node: yaml.Node) -> float:
        value = self.number(node)
        largest = 255.0 if name == 'highlight' else 1.0
        if not 0.0 <= value <= largest:
            raise self.error(node, f'{name} {value:g}', f'give 0 to {largest:g}')
        return value
