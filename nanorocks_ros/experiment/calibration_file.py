"""The calibration file: lens, pose of the plate, and regions of the trays.

YAML, with the lens as in sensor_msgs/CameraInfo, so that other tools can read it::

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
import os
import secrets
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.calibration import Calibration, CameraInfo, rectified_view
from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.view import IDENTITY
from nanorocks_ros.experiment.yaml_lines import (
    YamlLines,
    file_content,
    parse_yaml,
    shown_name,
)

if TYPE_CHECKING:
    from nanorocks_ros.settings import PipelineSettings


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file.

    Parameters
    ----------
    path : str or Path
        Of the file; or, with a line break in it, its content, as a recording keeps it.

    Raises
    ------
    ConfigurationError
        When it cannot be read or an entry cannot be used; names the line.
    """
    name = shown_name(path, 'calibration')
    text = file_content(path, 'a calibration file')
    return _File(name).calibration(parse_yaml(name, text))


class _File(YamlLines):
    """A calibration from the nodes of a file."""

    def calibration(self, root: yaml.Node | None) -> Calibration:
        top = self.mapping(root, {'camera_info', 'pixels_per_metre', 'trays'}, {'residual_px'})
        info = self._info(top['camera_info'])
        place = self.place(top['camera_info'])
        (scale,) = self._numbers(top['pixels_per_metre'], 1)
        if scale <= 0.0:
            raise self.error(top['pixels_per_metre'], f'a scale of {scale:g}', 'give px per metre')
        residual = self._numbers(top['residual_px'], 1)[0] if 'residual_px' in top else math.nan
        return Calibration(
            view=rectified_view(info, place),
            pixels_per_metre=scale,
            regions=self._regions(top['trays']),
            residual_px=residual,
            info=info,
        )

    def _info(self, node: yaml.Node) -> CameraInfo:
        entry = self.mapping(node, {'width', 'height', 'distortion_model', 'd', 'k'}, {'r', 'p'})
        (width,) = self._numbers(entry['width'], 1)
        (height,) = self._numbers(entry['height'], 1)
        for name, value in (('width', width), ('height', height)):
            if value < 1 or not value.is_integer():
                raise self.error(entry[name], f'{name} of {value:g} px', 'give the picture size')
        model = self.scalar(entry['distortion_model'])
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
        for key, value in self.pairs(node):
            if isinstance(key, bool) or not isinstance(key, int) or key < 1:
                raise self.error(value, f'tray {key!r}', 'number the trays 1, 2, ...')
            numbers = self._numbers(value, 4)
            are_integers = all(number.is_integer() for number in numbers)
            if not are_integers or min(numbers) < 0 or min(numbers[2:]) < 8:
                raise self.error(
                    value,
                    f'a region of {[f"{number:g}" for number in numbers]}',
                    'give x, y, width, height in whole pixels, the sides 8 or more',
                )
            regions[key] = Region(*(int(number) for number in numbers))
        if not regions:
            raise self.error(node, 'lists no tray', 'add at least one')
        return regions

    def _numbers(self, node: yaml.Node, count: int | None) -> tuple[float, ...]:
        values = tuple(self.number(value) for value in self.listed(node))
        if count is not None and len(values) != count:
            raise self.error(node, f'{len(values)} numbers', f'give {count}')
        return values


def write_calibration(calibration: Calibration, path: Path, remark: str) -> None:
    """Write a calibration file.

    Parameters
    ----------
    calibration : Calibration
    path : Path
    remark : str
        Comment in the first line of the file.

    Raises
    ------
    ConfigurationError
        When it cannot be written.
    """
    try:
        _write_whole(path, calibration_text(calibration, remark))
    except OSError as error:
        raise ConfigurationError(
            str(path), error.strerror or 'cannot be written', 'write elsewhere'
        ) from error


def calibration_text(calibration: Calibration, remark: str) -> str:
    """The content of a calibration file; parameters as of `write_calibration`."""
    info = calibration.info
    lines = [f'# {remark}', 'camera_info:', f'  width: {info.width}', f'  height: {info.height}']
    lines.append(f'  distortion_model: {info.distortion_model}')
    for name in ('d', 'k', 'r', 'p'):
        numbers = getattr(info, name)
        if numbers:
            lines.append(f'  {name}: [{", ".join(repr(float(value)) for value in numbers)}]')
    lines.append(f'pixels_per_metre: {float(calibration.pixels_per_metre)!r}')
    if math.isfinite(calibration.residual_px):
        lines.append(f'residual_px: {calibration.residual_px:.4f}')
    lines.append('trays:')
    for number, region in sorted(calibration.regions.items()):
        lines.append(f'  {number}: [{", ".join(str(side) for side in region)}]')
    return '\n'.join(lines) + '\n'


def _write_whole(path: Path, text: str) -> None:
    """Write a file, complete or not at all; `outputs` is of a layer that may not be used here."""
    part = path.with_name(f'.{path.stem}.{secrets.token_hex(8)}.part')
    try:
        with part.open('x', encoding='utf-8') as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def calibrated(settings: PipelineSettings) -> PipelineSettings:
    """The settings with scale and regions of the calibration file, if one is named.

    Raises
    ------
    ConfigurationError
        When the file cannot be used, or lacks a tray.
    """
    path = settings.preprocess.calibration
    if not path:
        return settings
    calibration = load_calibration(path)
    missing = [str(tray) for tray in settings.trays if tray not in calibration.regions]
    if missing:
        raise ConfigurationError(
            shown_name(path, 'calibration'),
            f'holds no region of tray {", ".join(missing)}',
            'calibrate with these trays, or leave them out of `trays`',
        )
    flat = tuple(value for number in settings.trays for value in calibration.regions[number])
    preprocess = replace(
        settings.preprocess, regions_px=flat, pixels_per_metre=calibration.pixels_per_metre
    )
    return replace(settings, preprocess=preprocess)
