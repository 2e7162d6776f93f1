"""Conversion of camera_info messages, of rosbags and of rclpy, to calibrations and views.

Tested by ``test/nodes/base/communication/test_ros_messages.py``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FrameError
from nanorocks_ros.experiment.calibration import CameraInfo, rectified_view
from nanorocks_ros.recordings.messages.message_builders import camera_info_message

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.experiment.view import View


def info_from_message(message: Any) -> CameraInfo:
    """Calibration in a sensor_msgs/CameraInfo."""
    return CameraInfo(
        width=int(message.width),
        height=int(message.height),
        distortion_model=str(message.distortion_model),
        d=_floats(message.d),
        k=_floats(message.k),
        r=_floats(message.r),
        p=_floats(message.p),
    )


def info_message(info: CameraInfo, stamp_ns: int, frame_id: str) -> Any:
    """A sensor_msgs/CameraInfo of a calibration.

    Parameters
    ----------
    info : CameraInfo
    stamp_ns : int, [ns]
    frame_id : str
    """
    message = camera_info_message(
        stamp_ns,
        frame_id,
        (info.width, info.height),
        np.array(info.k),
        (info.distortion_model, info.d),
    )
    rectified = replace(message, r=np.array(info.r, dtype=np.float64))
    return replace(rectified, p=np.array(info.p, dtype=np.float64)) if info.p else rectified


def view_from_message(message: Any, where: str) -> View:
    """The rectified view that a sensor_msgs/CameraInfo describes.

    Parameters
    ----------
    message : sensor_msgs/CameraInfo
    where : str
        The topic, for error messages.

    Raises
    ------
    FrameError
        If the distortion model is unknown, the parameters are impossible, or the images are
        binned or cropped.
    """
    roi = message.roi
    binned = max(int(message.binning_x), int(message.binning_y)) > 1
    if binned or roi.x_offset or roi.y_offset:
        raise FrameError(
            where, 'is for binned or cropped images', 'record whole images at full resolution'
        )
    try:
        return rectified_view(info_from_message(message), where)
    except ConfigurationError as error:
        remedy = f'{error.do}, or set preprocess.calibration'
        raise FrameError(error.where, error.what, remedy) from error


def _floats(numbers: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(number) for number in numbers)
