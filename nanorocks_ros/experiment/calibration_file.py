"""The calibration file: the lens, the pose of the plate, and where each tray is, in one.

YAML, with the lens in the words of sensor_msgs/CameraInfo, so that other tools can use it::

    camera_info:
      width: 1920
      height: 1080
      distortion_model: equidistant
      d: [k1, k2, k3, k4]
      k: [...]            # 9 numbers, row by row
      r: [...]            # 9 numbers; may be left out: no turn
      p: [...]            # 12 numbers; may be left out: as k
    pixels_per_metre: 12500.0
    residual_px: 0.12     # may be left out
    trays:
      1: [x, y, width, height]
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import Calibration, CameraInfo, view_of
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import IDENTITY

if TYPE_CHECKING:
    from nanorocks_ros.experiment.settings import PipelineSettings


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file.

    Raises
    ------
    ConfigurationError
        When it cannot be read or an entry cannot be used; names the line.
    """
    try:
        text = Path(path).read_text(encoding='utf-8')
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'is not UTF-8 text'
        raise ConfigurationError(str(path), reason, 'name a calibration file') from error
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = mark.line + 1 if mark else 1
        raise ConfigurationError(f'{path}:{line}', 'not YAML', 'correct this line') from error
    return _File(str(path)).calibration(root)


class _File:
    """Reads the composed YAML, in which every node still knows its line."""

    def __init__(self, name: str) -> None:
        self._name = name

    def calibration(self, root: yaml.Node | None) -> Calibration:
        top = self._entries(root, {'camera_info', 'pixels_per_metre', 'trays'}, {'residual_px'})
        info = self._info(top['camera_info'])
        where = self._where(top['camera_info'])
        (scale,) = self._numbers(top['pixels_per_metre'], 1)
        if scale <= 0.0:
            raise self._error(
                top['pixels_per_metre'], f'a scale of {scale:g}', 'give px per metre'
            )
        residual = self._numbers(top['residual_px'], 1)[0] if 'residual_px' in top else math.nan
        return Calibration(
            view=view_of(info, where),
            pixels_per_metre=scale,
            regions=self._regions(top['trays']),
            residual_px=residual,
            info=info,
        )

    def _info(self, node: yaml.Node) -> CameraInfo:
        entry = self._entries(node, {'width', 'height', 'distortion_model', 'd', 'k'}, {'r', 'p'})
        (width,) = self._numbers(entry['width'], 1)
        (height,) = self._numbers(entry['height'], 1)
        for name, value in (('width', width), ('height', height)):
            if value < 1 or not value.is_integer():
                raise self._error(entry[name], f'{name} of {value:g} px', 'give the picture size')
        model = self._plain(entry['distortion_model'])
        return CameraInfo(
            width=int(width),
            height=int(height),
            distortion_model=str(model),
            d=self._numbers(entry['d'], None),
            k=self._numbers(entry['k'], 9),
            r=self._numbers(entry['r'], 9) if 'r' in entry else IDENTITY,
            p=self._numbers(entry['p'], 12) if 'p' in entry else (),
        )

    def _regions(self, node: yaml.Node) -> dict[int, Region]:
        regions = {}
        for key, value in self._pairs(node):
            if isinstance(key, bool) or not isinstance(key, int) or key < 1:
                raise self._error(value, f'tray {key!r}', 'number the trays 1, 2, ...')
            numbers = self._numbers(value, 4)
            whole = all(one.is_integer() for one in numbers)
            if not whole or min(numbers) < 0 or min(numbers[2:]) < 8:
                raise self._error(
                    value,
                    f'a region of {[f"{one:g}" for one in numbers]}',
                    'give x, y, width, height in whole pixels, the sides 8 or more',
                )
            regions[key] = Region(*(int(one) for one in numbers))
        if not regions:
            raise self._error(node, 'lists no tray', 'add at least one')
        return regions

    def _where(self, node: yaml.Node | None) -> str:
        return self._name if node is None else f'{self._name}:{node.start_mark.line + 1}'

    def _error(self, node: yaml.Node | None, what: str, do: str) -> ConfigurationError:
        return ConfigurationError(self._where(node), what, do)

    def _pairs(self, node: yaml.Node | None) -> list[tuple[Any, yaml.Node]]:
        if not isinstance(node, yaml.MappingNode):
            raise self._error(node, 'expected "name: value" entries', 'correct this line')
        return [(self._plain(key), value) for key, value in node.value]

    def _entries(
        self, node: yaml.Node | None, needed: set[str], allowed: set[str]
    ) -> dict[str, yaml.Node]:
        entry = {str(key): value for key, value in self._pairs(node)}
        missing = sorted(needed - set(entry))
        unknown = sorted(set(entry) - needed - allowed)
        if missing:
            raise self._error(node, f'lacks {", ".join(missing)}', 'add it')
        if unknown:
            known = ', '.join(sorted(needed | allowed))
            raise self._error(entry[unknown[0]], f'unknown entry {unknown[0]!r}', f'use {known}')
        return entry

    def _plain(self, node: yaml.Node) -> Any:
        if not isinstance(node, yaml.ScalarNode):
            raise self._error(node, 'expected a single value', 'correct this line')
        try:
            return yaml.safe_load(node.value) if node.style is None else node.value
        except (yaml.YAMLError, ValueError) as error:
            raise self._error(node, f'{node.value!r} cannot be read', 'correct it') from error

    def _numbers(self, node: yaml.Node, count: int | None) -> tuple[float, ...]:
        nodes = node.value if isinstance(node, yaml.SequenceNode) else [node]
        values = [self._plain(one) for one in nodes]
        for one, value in zip(nodes, values, strict=True):
            usable = isinstance(value, int | float) and not isinstance(value, bool)
            if not usable or not math.isfinite(value):
                raise self._error(one, f'{value!r} is no finite number', 'correct this value')
        if count is not None and len(values) != count:
            raise self._error(node, f'{len(values)} numbers', f'give {count}')
        return tuple(float(value) for value in values)


def write_calibration(calibration: Calibration, path: Path, remark: str) -> None:
    """Write a calibration file.

    Parameters
    ----------
    calibration : Calibration
    path : Path
    remark : str
        One line for whoever opens the file.

    Raises
    ------
    ConfigurationError
        When it cannot be written.
    """
    info = calibration.info
    lines = [f'# {remark}', 'camera_info:', f'  width: {info.width}', f'  height: {info.height}']
    lines.append(f'  distortion_model: {info.distortion_model}')
    for name in ('d', 'k', 'r', 'p'):
        numbers = getattr(info, name)
        if numbers:
            lines.append(f'  {name}: [{", ".join(repr(float(one)) for one in numbers)}]')
    lines.append(f'pixels_per_metre: {float(calibration.pixels_per_metre)!r}')
    if math.isfinite(calibration.residual_px):
        lines.append(f'residual_px: {calibration.residual_px:.4f}')
    lines.append('trays:')
    for number, region in sorted(calibration.regions.items()):
        lines.append(f'  {number}: [{", ".join(str(one) for one in region)}]')
    try:
        path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(
            str(path), error.strerror or 'cannot be written', 'write elsewhere'
        ) from error


def calibrated(settings: PipelineSettings) -> PipelineSettings:
    """The settings with scale and regions as the calibration file says, where one is named.

    Raises
    ------
    ConfigurationError
        When the file cannot be used, or lacks a tray.
    """
    path = settings.preprocess.calibration
    if not path:
        return settings
    calibration = load_calibration(path)
    missing = [str(one) for one in settings.trays if one not in calibration.regions]
    if missing:
        raise ConfigurationError(
            path,
            f'holds no region of tray {", ".join(missing)}',
            'calibrate with these trays, or leave them out of `trays`',
        )
    flat = tuple(one for number in settings.trays for one in calibration.regions[number])
    preprocess = replace(
        settings.preprocess, regions_px=flat, pixels_per_metre=calibration.pixels_per_metre
    )
    return replace(settings, preprocess=preprocess)
