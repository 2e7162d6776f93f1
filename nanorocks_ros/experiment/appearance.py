"""What is told of the look of beads in a film: ``look:`` and ``colour:`` of the trays file.

Tested by ``test/experiment/test_trays.py``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import yaml

    from nanorocks_ros.experiment.yaml_lines import YamlLines

AUTO = 'auto'
LOOKS = {AUTO: 0, 'bright': 1, 'dark': -1}
"""Whether beads are brighter (1) or darker (-1) than the floor; 0: learnt from the film."""
COLOURS = {
    'black': (25.0, 25.0, 25.0),
    'gray': (128.0, 128.0, 128.0),
    'silver': (190.0, 190.0, 190.0),
    'white': (235.0, 235.0, 235.0),
    'red': (40.0, 35.0, 190.0),
    'orange': (30.0, 120.0, 230.0),
    'yellow': (40.0, 200.0, 225.0),
    'green': (50.0, 150.0, 50.0),
    'blue': (185.0, 80.0, 35.0),
    'purple': (140.0, 45.0, 120.0),
    'pink': (170.0, 120.0, 235.0),
    'brown': (35.0, 65.0, 110.0),
    'copper': (51.0, 115.0, 184.0),
    'gold': (60.0, 165.0, 205.0),
}
"""Colours by name, as blue, green and red in even light, [gray levels]."""
_HEX = re.compile(r'#?([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})')
COLOUR_FORMS = f'{", ".join((AUTO, *COLOURS))}, or red, green, blue as "#c03020"'
"""How a colour may be told."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """How beads look in the film; everything else is learnt from it.

    Parameters
    ----------
    sign : int
        1: brighter than the floor, -1: darker, 0: learnt from the film.
    colour : tuple of 3 floats or None, bgr, [gray levels]
        None: learnt from the film.
    """

    sign: int = 0
    colour: tuple[float, float, float] | None = None


def read_appearance(
    lines: YamlLines, look: yaml.Node | None, colour: yaml.Node | None
) -> Appearance | None:
    """What the entries of a species tell; None where it has none.

    Raises
    ------
    ConfigurationError
        When an entry cannot be used; names the line.
    """
    if look is None and colour is None:
        return None
    word = AUTO if look is None else str(lines.scalar(look))
    if word not in LOOKS:
        raise lines.error(look, f'unknown look {word!r}', f'use {", ".join(LOOKS)}')
    name = AUTO if colour is None else str(lines.scalar(colour))
    return Appearance(sign=LOOKS[word], colour=_colour(lines, colour, name))


def is_colour(name: str) -> bool:
    """Whether a colour can be told by this name."""
    return name == AUTO or name in COLOURS or _HEX.fullmatch(name) is not None


def _colour(
    lines: YamlLines, node: yaml.Node | None, name: str
) -> tuple[float, float, float] | None:
    if name == AUTO:
        return None
    if name in COLOURS:
        return COLOURS[name]
    levels = _HEX.fullmatch(name)
    if levels is None:
        raise lines.error(node, f'unknown colour {name!r}', f'use {COLOUR_FORMS}')
    red, green, blue = (float(int(level, 16)) for level in levels.groups())
    return blue, green, red
