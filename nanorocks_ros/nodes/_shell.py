"""What turns records into messages and back: the edge between the core and ROS."""

from __future__ import annotations

from array import array
from importlib import import_module

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Float32MultiArray, MultiArrayDimension

from nanorocks_ros.wire.array_layouts import layout, to_array
from nanorocks_ros.wire.bead_truth import beads_layout, beads_to_array

NS = 1_000_000_000
_ENCODINGS = {('uint8', 3): 'bgr8', ('uint8', 2): 'mono8', ('float32', 2): '32FC1'}


def message_class(type_name):
    """The class of a message type such as ``sensor_msgs/msg/Image``."""
    package, _, name = type_name.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def qos_of(topic):
    """The quality of service that a topic is declared with."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=topic.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
        ),
    )


def time_message(stamp_ns):
    """A stamp as builtin_interfaces/Time."""
    return Time(sec=stamp_ns // NS, nanosec=stamp_ns % NS)


def stamp_of(time):
    """The stamp [ns] in a builtin_interfaces/Time."""
    return time.sec * NS + time.nanosec


def _bytes(pixels):
    # Assigning an ndarray to `data` is checked element by element, over a second a frame;
    # an array of bytes is taken as it is.
    data = array('B')
    data.frombytes(np.ascontiguousarray(pixels).data.cast('B'))
    return data


def image_message(stamp_ns, frame_id, pixels, encoding=None):
    """An ndarray as sensor_msgs/Image.

    Parameters
    ----------
    stamp_ns : int
    frame_id : str
    pixels : ndarray of uint8 (rows, columns[, 3]) or of float32 (rows, columns)
    encoding : str, optional
        Where it is not bgr8, mono8 or 32FC1, which follow from the shape.
    """
    message = Image()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.height, message.width = pixels.shape[:2]
    message.encoding = encoding or _ENCODINGS[pixels.dtype.name, pixels.ndim]
    message.step = pixels.nbytes // pixels.shape[0]
    message.data = _bytes(pixels)
    return message


def compressed_message(stamp_ns, frame_id, jpeg):
    """JPEG bytes as sensor_msgs/CompressedImage."""
    message = CompressedImage()
    message.header.stamp = time_message(stamp_ns)
    message.header.frame_id = frame_id
    message.format = 'bgr8; jpeg compressed bgr8'
    message.data = _bytes(np.frombuffer(jpeg, dtype=np.uint8))
    return message


def array_message(record, epoch_ns):
    """An estimate as Float32MultiArray, laid out as its message definition says."""
    message = Float32MultiArray()
    values = to_array(record, epoch_ns)
    size = len(values)
    label = layout(type(record)).label
    message.layout.dim = [MultiArrayDimension(label=label, size=size, stride=size)]
    data = array('f')
    data.frombytes(values.tobytes())
    message.data = data
    return message


def beads_message(truth, epoch_ns):
    """The truth about all beads of a tray as Float32MultiArray."""
    message = Float32MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label=label, size=size, stride=stride)
        for label, size, stride in beads_layout().dimensions(len(truth.radii))
    ]
    data = array('f')
    data.frombytes(beads_to_array(truth, epoch_ns).tobytes())
    message.data = data
    return message


def lens_message(stamp_ns, frame_id, camera):
    """A `Camera` as sensor_msgs/CameraInfo."""
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
