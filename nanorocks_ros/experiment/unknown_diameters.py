"""Species of a trays file whose diameter is to be found in a film: ``auto``, or left out."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, NamedTuple

import yaml

from nanorocks_ros.experiment.appearance import AUTO
from nanorocks_ros.experiment.yaml_lines import YamlLines, file_content, parse_yaml, shown_name

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

DIAMETER = 'diameter_mm'
"""Name of the entry."""


class UnknownDiameter(NamedTuple):
    """A species without a diameter.

    Parameters
    ----------
    tray : int
    species : int
        Place in the list of the tray.
    """

    tray: int
    species: int


def unknown_diameters(trays_file: str | Path) -> tuple[UnknownDiameter, ...]:
    """The species of a trays file whose diameter is not told.

    Parameters
    ----------
    trays_file : str or Path
        Of the file; or, with a line break in it, its content; empty: the trays of the flight.

    Raises
    ------
    ConfigurationError
        When the file cannot be read. Of entries that are wrong `load_trays` tells.
    """
    return tuple(_missing(trays_file)) if str(trays_file) else ()


def finding_diameters(trays_file: str) -> str:
    """How the diameters of a trays file come to be known, for errors."""
    file = shlex.quote(trays_file)
    return (
        f'with "look: auto", `nanorocks track FILM --trays-file {file}` finds it and prints the '
        'entry, and so does, from a camera, `ros2 run nanorocks_ros pipeline --ros-args '
        f'-p source:=topic -p trays_file:={file}`'
    )


def with_diameters(trays_file: str | Path, diameters: Mapping[UnknownDiameter, float]) -> str:
    """The content of the file with diameters, in mm, where there were none.

    Parameters
    ----------
    trays_file : str or Path
        Of the file; or its content.
    diameters : mapping of UnknownDiameter to float, [mm]

    Raises
    ------
    ConfigurationError
        When the file cannot be read.
    """
    text = file_content(trays_file, 'a readable YAML file of trays')
    places = {place: diameters[key] for key, place in _missing(trays_file).items()}
    for place in sorted(places, key=lambda span: -span.start):
        new = f'{place.before}{places[place]:.6g}{place.after}'
        text = text[: place.start] + new + text[place.end :]
    return text


class _Place(NamedTuple):
    """Part of a text that a number replaces, and what stands before and after the number."""

    start: int
    end: int
    before: str = ''
    after: str = ''


def _missing(trays_file: str | Path) -> dict[UnknownDiameter, _Place]:
    """Where the diameters that are missing belong."""
    name = shown_name(str(trays_file), 'trays file')
    root = parse_yaml(name, file_content(trays_file, 'a readable YAML file of trays'))
    reader = YamlLines(name)
    missing = {}
    for number, tray in _entries(reader, _entry(reader, root, 'trays')):
        species = _entry(reader, tray, 'species')
        nodes = species.value if isinstance(species, yaml.SequenceNode) else []
        for k, node in enumerate(nodes):
            place = _place(reader, node)
            if place is not None and isinstance(number, int):
                missing[UnknownDiameter(number, k)] = place
    return missing


def _place(reader: YamlLines, node: yaml.Node) -> _Place | None:
    """Where the diameter of a species belongs; None where it is told."""
    if not isinstance(node, yaml.MappingNode) or not node.value:
        return None
    told = _entry(reader, node, DIAMETER)
    if told is not None:
        is_auto = isinstance(told, yaml.ScalarNode) and told.value == AUTO
        return _Place(told.start_mark.index, told.end_mark.index) if is_auto else None
    first = node.value[0][0].start_mark
    # Entries within braces stand behind commas, others in lines of their own.
    after = ', ' if node.flow_style else '\n' + ' ' * first.column
    return _Place(first.index, first.index, f'{DIAMETER}: ', after)


def _entry(reader: YamlLines, node: yaml.Node | None, name: str) -> yaml.Node | None:
    return dict(_entries(reader, node)).get(name)


def _entries(reader: YamlLines, node: yaml.Node | None) -> list[tuple[object, yaml.Node]]:
    return reader.pairs(node) if isinstance(node, yaml.MappingNode) else []
