"""The configuration for RViz 2."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.tools.viewer_layouts.charts import PICTURES
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from nanorocks_ros.wire.topics import Topic


def _rviz_image(topic: Topic, tray: int, *, enabled: bool) -> dict[str, Any]:
    lowest = -1 if topic is topics.AUTOCORRELATION else 0
    return {
        'Class': 'rviz_default_plugins/Image',
        'Enabled': enabled,
        'Value': enabled,
        'Name': topic.of(tray),
        'Normalize Range': False,
        'Min Value': lowest,
        'Max Value': 1,
        'Median window': 5,
        'Topic': {
            'Depth': 5,
            'Durability Policy': 'Transient Local' if topic.latched else 'Volatile',
            'History Policy': 'Keep Last',
            # What is offered is reliable; best effort would lose most frames of 1080p.
            'Reliability Policy': 'Reliable',
            'Value': topic.absolute(tray),
        },
    }


def rviz() -> str:
    """The configuration for RViz 2: the camera and the pictures of tray 1; the others unticked."""
    groups = [
        {
            'Class': 'rviz_common/Group',
            'Enabled': tray == 1,
            'Value': tray == 1,
            'Name': f'tray {tray}',
            'Displays': [_rviz_image(topic, tray, enabled=tray == 1) for topic in PICTURES],
        }
        for tray in load_trays()
    ]
    content = {
        'Panels': [{'Class': 'rviz_common/Displays', 'Name': 'Displays'}],
        'Visualization Manager': {
            'Class': '',
            'Displays': [_rviz_image(topics.RAW, 0, enabled=True), *groups],
            'Enabled': True,
            'Global Options': {
                'Background Color': '48; 48; 48',
                'Fixed Frame': 'camera',
                'Frame Rate': 30,
            },
            'Name': 'root',
            'Tools': [{'Class': 'rviz_default_plugins/MoveCamera'}],
            'Value': True,
            'Views': {
                'Current': {
                    'Class': 'rviz_default_plugins/Orbit',
                    'Name': 'Current View',
                    'Value': 'Orbit (rviz)',
                },
                'Saved': None,
            },
        },
        'Window Geometry': {'Width': 1400, 'Height': 900},
    }
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=False))
