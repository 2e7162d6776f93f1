"""The section ``film`` of a trays file: where the tray is in the picture, and at which scale.

With it the file alone says all that the pipeline has to be told of a film.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import yaml

from nanorocks_ros.experiment.yaml_lines import YamlLines, file_content, parse_yaml, shown_name

if TYPE_CHECKING:
    from pathlib import Path

SECTION = 'film'
"""Name of the section in a trays file."""

_KNOWN, _ASSUMED = 'known', 'assumed'


class FilmSection(NamedTuple):
    """What a trays file says of the film that it was made for.

    Parameters
    ----------
    pixels_per_metre : float, [px/m]
        Nominal where the scale is not known.
    region_px : tuple of 4 ints, [px]
        Column, row, width and height of the tray in the picture.
    scale_known : bool
        Whether lengths are known, and not only numbers of pixels.
    container_known : bool
        Whether the tray is the container of the beads, with its height; else it is the whole
        picture.
    """

    pixels_per_metre: float
    region_px: tuple[int, int, int, int]
    scale_known: bool = True
    container_known: bool = True

    def settings(self) -> dict[str, Any]:
        """Settings of the pipeline by name that follow."""
        values: dict[str, Any] = {
            'preprocess.pixels_per_metre': self.pixels_per_metre,
            'preprocess.regions_px': list(self.region_px),
        }
        if not self.container_known:
            # There are no walls to compare with, or to register by.
            values |= {'preprocess.stabilise': False, 'preprocess.check_tray_positions': False}
        return values

    def text(self) -> str:
        """The section as YAML, one line."""
        region = ', '.join(str(value) for value in self.region_px)
        return (
            f'{SECTION}: {{pixels_per_metre: {self.pixels_per_metre:.8g}, region_px: [{region}], '
            f'scale: {_KNOWN if self.scale_known else _ASSUMED}, '
            f'container: {_KNOWN if self.container_known else _ASSUMED}}}\n'
        )


def film_section(trays_file: str | Path) -> FilmSection | None:
    """The section of a trays file; None without one.

    Parameters
    ----------
    trays_file : str or Path
        Of the file; or, with a line break in it, its content; empty: the trays of the flight.

    Raises
    ------
    ConfigurationError
        When the file cannot be read or the section cannot be used; names the line.
    """
    if not str(trays_file):
        return None
    name = shown_name(trays_file, 'trays file')
    root = parse_yaml(name, file_content(trays_file, 'a readable YAML file of trays'))
    reader = _SectionFile(name)
    if not isinstance(root, yaml.MappingNode):
        return None
    node = dict(reader.pairs(root)).get(SECTION)
    return None if node is None else reader.section(node)


class _SectionFile(YamlLines):
    """The section from its node."""

    def section(self, node: yaml.Node) -> FilmSection:
        entry = self.mapping(node, {'pixels_per_metre', 'region_px'}, {'scale', 'container'})
        region = [self.number(item) for item in self.listed(entry['region_px'])]
        if len(region) != 4 or min(region) < 0 or any(value % 1 for value in region):
            raise self.error(
                entry['region_px'],
                f'a region of {region}',
                'give column, row, width and height in whole pixels',
            )
        column, row, width, height = (int(value) for value in region)
        return FilmSection(
            pixels_per_metre=self.positive(entry['pixels_per_metre']),
            region_px=(column, row, width, height),
            scale_known=self._known(entry.get('scale')),
            container_known=self._known(entry.get('container')),
        )

    def _known(self, node: yaml.Node | None) -> bool:
        if node is None:
            return True
        value = self.scalar(node)
        if value not in (_KNOWN, _ASSUMED):
            raise self.error(node, f'{value!r}', f'say {_KNOWN} or {_ASSUMED}')
        return bool(value == _KNOWN)
