"""Calibration of a film: lens, pose, scale, and regions of the trays.

Tested by ``test/experiment/test_view.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.lens import Camera, PlumbBob
from nanorocks_ros.experiment.view import IDENTITY, View, view_from_matrices

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.plate import Region

MODELS = ('equidistant', 'plumb_bob')


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraInfo:
    """The numbers of a sensor_msgs/CameraInfo.

    Parameters
    ----------
    width, height : int, [px]
    distortion_model : str
    d : tuple of floats
        Coefficients of the distortion.
    k, r : tuple of 9 floats, row by row
    p : tuple of 12 floats, row by row
        ROS counts pixels from the centre of the first one.
    """

    width: int
    height: int
    distortion_model: str
    d: tuple[float, ...]
    k: tuple[float, ...]
    r: tuple[float, ...] = IDENTITY
    p: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Lens, pose, scale and tray regions.

    Parameters
    ----------
    view : View
    pixels_per_metre : float, [px/m]
        Of the plate in the rectified picture.
    regions : dict of int to Region
        Floors of the trays in the rectified picture, by number.
    residual_px : float, [px]
        Rms reprojection error of the edges; NaN when unknown.
    info : CameraInfo
    """

    view: View
    pixels_per_metre: float
    regions: dict[int, Region]
    info: CameraInfo
    residual_px: float = math.nan


def rectified_view(info: CameraInfo, place: str) -> View:
    """The rectified view that a camera_info describes.

    Parameters
    ----------
    info : CameraInfo
    where : str
        Topic or file, for errors.

    Raises
    ------
    ConfigurationError
        For an unknown distortion model or invalid numbers.
    """
    if info.distortion_model not in MODELS:
        raise ConfigurationError(
            place,
            f'distortion model {info.distortion_model!r} is not supported',
            f'calibrate for {" or ".join(MODELS)}',
        )
    if len(info.k) != 9 or len(info.r) != 9 or len(info.p) not in (0, 12):
        raise ConfigurationError(
            place,
            f'{len(info.k)}, {len(info.r)}, {len(info.p)} numbers in k, r, p',
            'give 9, 9, 12',
        )
    focal = (info.k[0], info.k[4])
    centre = (info.k[2] + 0.5, info.k[5] + 0.5)
    if info.k[0] == 0.0:
        raise ConfigurationError(
            place, 'k is all zero: the camera is not calibrated', 'calibrate it, or leave it out'
        )
    lens: Camera | PlumbBob
    try:
        if info.distortion_model == 'equidistant':
            bend = _padded(info.d, 4)
            lens = Camera(
                width=info.width,
                height=info.height,
                focal=focal,
                centre=centre,
                distortion=(bend[0], bend[1], bend[2], bend[3]),
            )
        else:
            bend = _padded(info.d, 5)
            lens = PlumbBob(
                width=info.width,
                height=info.height,
                focal=focal,
                centre=centre,
                distortion=(bend[0], bend[1], bend[2], bend[3], bend[4]),
            )
    except ConfigurationError as error:
        raise ConfigurationError(place, error.what, error.do) from error
    straight = (info.k[0], 0.0, info.k[2], 0.0, 0.0, info.k[4], info.k[5], 0.0, 0.0, 0.0, 1.0, 0.0)
    # An uncalibrated P is all zero.
    projection = info.p if any(info.p) else straight
    rotation_matrix = info.r if any(info.r) else IDENTITY
    return view_from_matrices(lens, rotation_matrix, projection, place)


def _padded(numbers: Sequence[float], count: int) -> tuple[float, ...]:
    return (*numbers[:count], *((0.0,) * (count - len(numbers))))
