"""Conversion between records and ROS messages, and the quality of service of the topics."""

from __future__ import annotations

from array import array
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from nanorocks_ros.records import NS
from nanorocks_ros.wire.array_layouts import layout, to_array
from nanorocks_ros.wire.bead_truth import beads_layout, beads_to_array

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.lens import Camera
    from nanorocks_ros.records import ArrayRecord, BeadsTruth
    from nanorocks_ros.wire.topics import Topic

_ENCODINGS = {('uint8', 3): 'bgr8', ('uint8', 2): 'mono8', ('float32', 2): '32FC1'}


def message_class(type_name: str) -> Any:
    """The class of a message type such as ``sensor_msgs/msg/Image``.

    Raises
    ------
    ImportError, AttributeError, ValueError
        When the type is not installed, or its name is malformed.
    """
    package, _, name = type_name.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def qos_of(topic: Topic) -> QoSProfile:
    """The quality of service that a topic is declared with."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
        ),
    )


def time_message(stamp_ns: int) -> Time:
    """A stamp as builtin_interfaces/Time."""
    return Time(sec=stamp_ns // NS, nanosec=stamp_ns % NS)


def stamp_of(time: Time) -> int:
    """The stamp [ns] in a builtin_interfaces/Time."""
    return int(time.sec) * NS + int(time.nanosec)


def _bytes(pixels: NDArray[Any]) -> array[int]:
    # rclpy checks an ndarray assigned to `data` element by element, over a second per frame;
    # it takes an array of bytes as it is.
    data = array('B')
    data.frombytes(np.ascontiguousarray(pixels).data.cast('B'))
    return data


def image_message(
    stamp_ns: int, frame_id: str, pixels: NDArray[Any], encoding: str | None = None
) -> Image:
    """An ndarray as sensor_msgs/Image.

    Parameters
    ----------
    stamp_ns : int, [ns]
    frame_id : str
    pixels : ndarray of uint8 (rows, columns[, 3]) or of float32 (rows, columns)
    encoding : str, optional
        Default: bgr8, mono8 or 32FC1, which follow from dtype and shape.
    """
    message = Image()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding or _ENCODINGS[pixels.dtype.name, pixels.ndim]
    message.step = pixels.nbytes // pixels.shape[0]
    message.data = _bytes(pixels)
    return message


def compressed_message(stamp_ns: int, frame_id: str, jpeg: bytes) -> CompressedImage:
    """JPEG bytes as sensor_msgs/CompressedImage."""
    message = CompressedImage()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.format = 'bgr8; jpeg compressed bgr8'
    message.data = _bytes(np.frombuffer(jpeg, dtype=np.uint8))
    return message


def array_message(record: ArrayRecord, epoch_ns: int) -> Float32MultiArray:
    """A record as Float32MultiArray, laid out as its message definition says."""
    message = Float32MultiArray()
    values = to_array(record, epoch_ns)
    size = len(values)
    label = layout(type(record)).label
    message.layout.dim = [MultiArrayDimension(label=label, size=size, stride=size)]
    data = array('f')
    data.frombytes(values.tobytes())
    message.data = data
    return message


def beads_message(truth: BeadsTruth, epoch_ns: int) -> Float32MultiArray:
    """The true state of all beads of a tray as Float32MultiArray."""
    message = Float32MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label=label, size=size, stride=stride)
        for label, size, stride in beads_layout().dimensions(len(truth.radii))
    ]
    data = array('f')
    data.frombytes(beads_to_array(truth, epoch_ns).tobytes())
    message.data = data
    return message


def camera_info_message(stamp_ns: int, frame_id: str, camera: Camera) -> CameraInfo:
    """The camera model as sensor_msgs/CameraInfo."""
    message = CameraInfo()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.width, message.height = camera.width, camera.height
    message.distortion_model = 'equidistant'
    message.d = [float(value) for value in camera.distortion]
    matrix = camera.matrix
    message.k = matrix.ravel().tolist()
    message.r = np.eye(3).ravel().tolist()
    message.p = np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist()
    return message


def node_name_of(endpoint: Any) -> str:
    """The full name of the node that a publisher or subscription belongs to.

    Parameters
    ----------
    endpoint : rclpy.topic_endpoint_info.TopicEndpointInfo
    """
    return f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}'
