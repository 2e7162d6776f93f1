"""Every topic by name and quality of service, declared here and nowhere else.

Tested by ``test/wire/test_products.py``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

IMAGE = 'sensor_msgs/msg/Image'
COMPRESSED = 'sensor_msgs/msg/CompressedImage'
INFO = 'sensor_msgs/msg/CameraInfo'
ARRAY = 'std_msgs/msg/Float32MultiArray'
HEADER = 'std_msgs/msg/Header'
TIME = 'builtin_interfaces/msg/Time'

NAMESPACE = '/nanorocks'
"""Where the graph lives unless it is moved; topics below are relative to it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """A topic and how it is offered.

    Parameters
    ----------
    name : str
        Relative; ``{tray}`` stands for the number of a tray.
    type : str
    depth : int
        Messages kept for a slow subscriber.
    latched : bool
        Transient local: a late subscriber still gets the last one.
    doc : str
    """

    name: str
    type: str
    depth: int
    latched: bool = False
    doc: str = ''

    def of(self, tray: int) -> str:
        """The name for one tray."""
        return self.name.format(tray=tray)

    def absolute(self, tray: int = 0) -> str:
        """The name under the default namespace, as bags hold it."""
        return f'{NAMESPACE}/{self.of(tray)}'


# Best effort lost up to 149 of 150 frames of 1080p in UDP fragments, reliable none; a deep
# queue of 6 MB images would only add delay.
RAW = Topic(
    name='camera/image_raw',
    type=IMAGE,
    depth=10,
    doc='the camera: bgr8, rgb8, mono8, or with alpha, Bayer, 4:2:2 YUV, mono16',
)
# Of small pictures two seconds are kept: as long as a busy machine may hold up who follows them.
RAW_COMPRESSED = Topic(
    name='camera/image_raw/compressed', type=COMPRESSED, depth=60, doc='the camera, JPEG or PNG'
)
RECTIFIED = Topic(
    name='tray_{tray}/image_rect_color', type=IMAGE, depth=30, doc='crop of the tray, bgr8'
)
GRAY = Topic(
    name='tray_{tray}/image_gray', type=IMAGE, depth=30, doc='gray mix of the crop, mono8'
)
STATE = Topic(
    name='tray_{tray}/state',
    type=ARRAY,
    depth=100,
    doc='TrayState: cycle, displacement, quality of the images of the same stamp',
)
MOTION = Topic(
    name='tray_{tray}/motion', type=IMAGE, depth=10, doc='motion mask, mono8: 255 where it moves'
)
SPEED = Topic(name='tray_{tray}/speed', type=ARRAY, depth=1000, doc='SpeedEstimate')
TRACKS = Topic(
    name='tray_{tray}/tracks',
    type=IMAGE,
    depth=10,
    doc='the tray with its beads and the ways they came, bgr8, ten a second; hidden beads are '
    'magenta',
)
REBOUND = Topic(
    name='tray_{tray}/rebound', type=ARRAY, depth=1000, doc='Rebound: of a bead from a side wall'
)
COLLISION = Topic(
    name='tray_{tray}/collision', type=ARRAY, depth=1000, doc='PairCollision: of two beads'
)
FLIGHT = Topic(
    name='tray_{tray}/flight',
    type=ARRAY,
    depth=1000,
    doc='FreeFlight: of a bead between two contacts, with its bend',
)
BODIES = Topic(
    name='tray_{tray}/bodies',
    type=ARRAY,
    depth=1000,
    doc='BodyEstimate: single beads and clusters',
)
MERGE = Topic(
    name='tray_{tray}/merge', type=ARRAY, depth=1000, doc='Merge: of two beads that stick'
)
CLUSTER = Topic(name='tray_{tray}/cluster', type=ARRAY, depth=1000, doc='ClusterEstimate')
AUTOCORRELATION = Topic(
    name='tray_{tray}/autocorrelation',
    type=IMAGE,
    depth=10,
    doc='normalised autocorrelation, 32FC1, zero lag in the centre',
)
COR = Topic(
    name='tray_{tray}/cor', type=ARRAY, depth=100, latched=True, doc='CorEstimate, live and final'
)
TRUTH = Topic(name='tray_{tray}/truth', type=ARRAY, depth=1000, doc='GroundTruth, simulator only')
BEADS = Topic(
    name='tray_{tray}/beads', type=ARRAY, depth=30, doc='BeadsTruth, simulator of the scene only'
)
CAMERA_INFO = Topic(
    name='camera/camera_info',
    type=INFO,
    depth=1,
    latched=True,
    doc='the lens: equidistant, 4 coefficients',
)
TAKEN = Topic(
    name='camera/taken',
    type=HEADER,
    depth=100,
    doc='stamp of the last frame that node `frame_id` is done with, for `bag_player` at rate 0',
)
EPOCH = Topic(name='epoch', type=TIME, depth=1, latched=True, doc='what `time` counts from')

TOPICS = tuple(value for value in globals().values() if isinstance(value, Topic))
"""Every topic declared above, in this order."""


def tray_of(topic_name: str) -> int | None:
    """The tray number in a topic name, or None."""
    match = re.search(r'(?:^|/)tray_(\d+)/', topic_name)
    return int(match.group(1)) if match else None
