"""ROS messages built from arrays, time stamps and strings, for recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rosbags.typesys.stores import ros2_jazzy as jazzy

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

# Type and channels of a pixel; an image with one channel has no third axis.
_PIXELS = {
    'bgr8': (np.dtype(np.uint8), 3),
    'rgb8': (np.dtype(np.uint8), 3),
    'mono8': (np.dtype(np.uint8), 1),
    '32FC1': (np.dtype('<f4'), 1),
}


def time_message(stamp_ns: int) -> jazzy.builtin_interfaces__msg__Time:
    """builtin_interfaces/Time.

    Parameters
    ----------
    stamp_ns : int, [ns]
    """
    seconds, nanoseconds = divmod(stamp_ns, NS)
    return jazzy.builtin_interfaces__msg__Time(sec=seconds, nanosec=nanoseconds)


def _header(stamp_ns: int, frame_id: str) -> jazzy.std_msgs__msg__Header:
    return jazzy.std_msgs__msg__Header(stamp=time_message(stamp_ns), frame_id=frame_id)


def _channels(frame_id: str, encoding: str, image: NDArray[np.uint8] | NDArray[np.float32]) -> int:
    if encoding not in _PIXELS:
        supported = ', '.join(_PIXELS)
        raise FrameError(
            frame_id, f"encoding '{encoding}' is not supported ({supported})", 'convert the image'
        )
    dtype, channels = _PIXELS[encoding]
    fits = image.shape[2:] == ((channels,) if channels > 1 else ())
    if image.dtype != dtype or image.ndim < 2 or not fits:
        raise FrameError(
            frame_id,
            f'array of {image.dtype} with shape {image.shape} does not fit {encoding}',
            f'give {dtype} with {channels} channel{"s" if channels > 1 else ""}',
        )
    return channels


def image_message(
    stamp_ns: int, frame_id: str, encoding: str, image: NDArray[np.uint8] | NDArray[np.float32]
) -> jazzy.sensor_msgs__msg__Image:
    """sensor_msgs/Image; contiguous pixels are not copied.

    Parameters
    ----------
    stamp_ns : int, [ns]
        Time of exposure.
    frame_id : str
    encoding : str
        ``bgr8``, ``rgb8``, ``mono8`` or ``32FC1``.
    image : ndarray, (height, width, 3) or (height, width)

    Raises
    ------
    FrameError
        If the array does not fit the encoding.
    """
    channels = _channels(frame_id, encoding, image)
    height, width = image.shape[:2]
    return jazzy.sensor_msgs__msg__Image(
        header=_header(stamp_ns, frame_id),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=width * channels * image.dtype.itemsize,
        data=np.ascontiguousarray(image).reshape(-1).view(np.uint8),
    )


def compressed_image_message(
    stamp_ns: int, frame_id: str, form: str, content: bytes
) -> jazzy.sensor_msgs__msg__CompressedImage:
    """sensor_msgs/CompressedImage.

    Parameters
    ----------
    stamp_ns : int, [ns]
        Time of exposure.
    frame_id : str
    form : str
        The message's ``format``: ``jpeg``, ``png``, ``bgr8; jpeg compressed bgr8``.
    content : bytes
    """
    return jazzy.sensor_msgs__msg__CompressedImage(
        header=_header(stamp_ns, frame_id),
        format=form,
        data=np.frombuffer(content, dtype=np.uint8),
    )


def float_array_message(
    labels: Sequence[str], values: ArrayLike
) -> jazzy.std_msgs__msg__Float32MultiArray:
    """std_msgs/Float32MultiArray with the names of its elements.

    Parameters
    ----------
    labels : sequence of str
        Names of the elements; joined by commas they are the label of the only dimension.
    values : array of float, (n_labels,)

    Raises
    ------
    RecordingError
        If the numbers of values and labels differ.
    """
    data = np.asarray(values, dtype=np.float32)
    label = ','.join(labels)
    count = len(labels)
    if data.shape != (count,):
        raise RecordingError(
            label, f'values of shape {data.shape} for {count} labels', 'give one value per label'
        )
    dimension = jazzy.std_msgs__msg__MultiArrayDimension(label=label, size=count, stride=count)
    return jazzy.std_msgs__msg__Float32MultiArray(
        layout=jazzy.std_msgs__msg__MultiArrayLayout(dim=[dimension], data_offset=0), data=data
    )


def dimensioned_array_message(
    dimensions: Sequence[tuple[str, int, int]], values: ArrayLike
) -> jazzy.std_msgs__msg__Float32MultiArray:
    """std_msgs/Float32MultiArray with several dimensions.

    Parameters
    ----------
    dimensions : sequence of (str, int, int)
        Label, size and stride of each.
    values : array of float, (n,)
    """
    return jazzy.std_msgs__msg__Float32MultiArray(
        layout=jazzy.std_msgs__msg__MultiArrayLayout(
            dim=[
                jazzy.std_msgs__msg__MultiArrayDimension(label=label, size=size, stride=stride)
                for label, size, stride in dimensions
            ],
            data_offset=0,
        ),
        data=np.asarray(values, dtype=np.float32),
    )


def camera_info_message(
    stamp_ns: int,
    frame_id: str,
    size: tuple[int, int],
    camera_matrix: NDArray[np.float64],
    distortion: tuple[str, Sequence[float]],
) -> jazzy.sensor_msgs__msg__CameraInfo:
    """sensor_msgs/CameraInfo of a camera that is not part of a stereo pair.

    Parameters
    ----------
    stamp_ns : int, [ns]
    frame_id : str
    size : tuple of int
        Width and height, [px].
    camera_matrix : ndarray, (3, 3), [px]
    distortion : tuple
        Model (``equidistant``, ``plumb_bob``) and its coefficients.
    """
    width, height = size
    model, coefficients = distortion
    matrix = np.asarray(camera_matrix, dtype=np.float64).reshape(3, 3)
    region = jazzy.sensor_msgs__msg__RegionOfInterest(
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    return jazzy.sensor_msgs__msg__CameraInfo(
        header=_header(stamp_ns, frame_id),
        height=height,
        width=width,
        distortion_model=model,
        d=np.asarray(coefficients, dtype=np.float64),
        k=matrix.reshape(9),
        r=np.eye(3).reshape(9),
        p=np.hstack([matrix, np.zeros((3, 1))]).reshape(12),
        binning_x=0,
        binning_y=0,
        roi=region,
    )
