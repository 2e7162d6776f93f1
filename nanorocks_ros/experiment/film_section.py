"""The section ``film`` of a trays file: where the tray is in the picture, and at which scale.

With it the file alone says all that the pipeline has to be told of a film.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import Calibration, rectified_view
from nanorocks_ros.experiment.calibration_file import calibration_text
from nanorocks_ros.experiment.oblique_view import Perspective, clockwise
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.trays import FILM_SECTION
from nanorocks_ros.experiment.yaml_lines import YamlLines, file_content, parse_yaml, shown_name

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

_KNOWN, _ASSUMED = 'known', 'assumed'


class FilmSection(NamedTuple):
    """What a trays file says of the film that it was made for.

    Parameters
    ----------
    pixels_per_metre : float, [px/m]
        Nominal where the scale is not known.
    region_px : tuple of 4 ints, [px]
        Column, row, width and height of the tray in the picture; where it is seen at an angle,
        in the rectified one.
    scale_known : bool
        Whether lengths are known, and not only numbers of pixels.
    container_known : bool
        Whether the tray is the container of the beads, with its height; else it is the whole
        picture.
    corners_px : tuple of four (float, float), [px]
        Of a tray that is seen at an angle, as of `Perspective`; else empty.
    picture_px : tuple of 2 ints, [px]
        Width and height of the film that these corners are told for.
    tray : int
        Number of the tray.
    """

    pixels_per_metre: float
    region_px: tuple[int, int, int, int]
    scale_known: bool = True
    container_known: bool = True
    corners_px: tuple[tuple[float, float], ...] = ()
    picture_px: tuple[int, int] = (0, 0)
    tray: int = 1

    @property
    def perspective(self) -> Perspective | None:
        """How the tray is seen at an angle; None where it is seen from straight above."""
        return Perspective(self.corners_px, self.region_px[2:]) if self.corners_px else None

    @property
    def outline_px(self) -> tuple[tuple[float, float], ...]:
        """The corners of the tray in the film, clockwise, [px]."""
        column, row, width, height = self.region_px
        right, bottom = column + width, row + height
        return self.corners_px or ((column, row), (right, row), (right, bottom), (column, bottom))

    def crop(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The tray in a frame, rectified."""
        if self.perspective is not None:
            return self.perspective.rectified(image)
        column, row, width, height = self.region_px
        return np.ascontiguousarray(image[row : row + height, column : column + width])

    def film_discs(self, discs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Discs (n, 3) in the tray as they are in the film: column, row, radius, [px]."""
        if self.perspective is not None:
            return self.perspective.film_discs(discs)
        return np.asarray(discs + np.array([*self.region_px[:2], 0.0]))

    def settings(self) -> dict[str, Any]:
        """Settings of the pipeline by name that follow."""
        values: dict[str, Any] = {
            'preprocess.pixels_per_metre': self.pixels_per_metre,
            'preprocess.regions_px': list(self.region_px),
        }
        if self.perspective is not None:
            values = {'preprocess.calibration': self._calibration(self.perspective)}
        if not self.container_known:
            # There are no walls to compare with, or to register by.
            values |= {'preprocess.stabilise': False, 'preprocess.check_tray_positions': False}
        return values

    def text(self) -> str:
        """The section as YAML, one line."""
        region = ', '.join(str(value) for value in self.region_px)
        oblique = ''
        if self.corners_px:
            corners = ', '.join(f'[{x:.6g}, {y:.6g}]' for x, y in self.corners_px)
            oblique = f'corners_px: [{corners}], picture_px: [{self.picture_px[0]}, '
            oblique += f'{self.picture_px[1]}], '
        return (
            f'{FILM_SECTION}: {{pixels_per_metre: {self.pixels_per_metre:.8g}, '
            f'region_px: [{region}], '
            f'{oblique}scale: {_KNOWN if self.scale_known else _ASSUMED}, '
            f'container: {_KNOWN if self.container_known else _ASSUMED}}}\n'
        )

    def _calibration(self, perspective: Perspective) -> str:
        """A calibration file of the rectified picture."""
        info = perspective.camera_info(self.picture_px)
        calibration = Calibration(
            view=rectified_view(info, FILM_SECTION),
            pixels_per_metre=self.pixels_per_metre,
            regions={self.tray: Region(*self.region_px)},
            info=info,
        )
        return calibration_text(calibration, 'the corners of the container')


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
    entries = dict(reader.pairs(root))
    node = entries.get(FILM_SECTION)
    if node is None:
        return None
    trays = entries.get('trays')
    numbers = [] if not isinstance(trays, yaml.MappingNode) else reader.pairs(trays)
    return reader.section(node, [number for number, _ in numbers])


class _SectionFile(YamlLines):
    """The section from its node."""

    def section(self, node: yaml.Node, trays: Sequence[object]) -> FilmSection:
        optional = {'scale', 'container', 'corners_px', 'picture_px'}
        entry = self.mapping(node, {'pixels_per_metre', 'region_px'}, optional)
        region = [self.number(item) for item in self.listed(entry['region_px'])]
        if len(region) != 4 or min(region) < 0 or any(value % 1 for value in region):
            raise self.error(
                entry['region_px'],
                f'a region of {region}',
                'give column, row, width and height in whole pixels',
            )
        column, row, width, height = (int(value) for value in region)
        oblique: dict[str, Any] = {}
        if 'corners_px' in entry:
            if (column, row) != (0, 0) or len(trays) != 1 or not isinstance(trays[0], int):
                raise self.error(
                    entry['corners_px'],
                    'corners beside several trays, or a region that does not begin at [0, 0]',
                    'describe one tray: nanorocks tray FILM --corners',
                )
            oblique = {
                'corners_px': self._corners(entry['corners_px']),
                'picture_px': self._size(entry.get('picture_px', node)),
                'tray': trays[0],
            }
        return FilmSection(
            pixels_per_metre=self.positive(entry['pixels_per_metre']),
            region_px=(column, row, width, height),
            scale_known=self._known(entry.get('scale')),
            container_known=self._known(entry.get('container')),
            **oblique,
        )

    def _corners(self, node: yaml.Node) -> tuple[tuple[float, float], ...]:
        corners = [
            [self.number(item) for item in self.listed(place)] for place in self.listed(node)
        ]
        if len(corners) != 4 or any(len(corner) != 2 for corner in corners):
            raise self.error(node, 'no four corners', 'give [[x, y], ...], in px of the film')
        try:
            return clockwise([(x, y) for x, y in corners])
        except ConfigurationError as error:
            raise self.error(node, error.what, error.do) from error

    def _size(self, node: yaml.Node) -> tuple[int, int]:
        size = []
        if isinstance(node, yaml.SequenceNode):
            size = [self.number(item) for item in self.listed(node)]
        if len(size) != 2 or min(size) < 1 or any(value % 1 for value in size):
            raise self.error(
                node, 'corners without picture_px', 'give width and height of the film in px'
            )
        return int(size[0]), int(size[1])

    def _known(self, node: yaml.Node | None) -> bool:
        if node is None:
            return True
        value = self.scalar(node)
        if value not in (_KNOWN, _ASSUMED):
            raise self.error(node, f'{value!r}', f'say {_KNOWN} or {_ASSUMED}')
        return bool(value == _KNOWN)
