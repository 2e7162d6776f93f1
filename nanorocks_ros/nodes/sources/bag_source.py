"""The camera in a bag as a source of frames, and the parameters that choose the bag."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.nodes.base.parameter_checks import command_line_parameters
from nanorocks_ros.nodes.base.told_settings import completed_settings
from nanorocks_ros.recordings.bag.bag_folder import read_metadata
from nanorocks_ros.settings import (
    BagSettings,
    PipelineSettings,
)
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rclpy.node import Node

    from nanorocks_ros.errors import FrameError
    from nanorocks_ros.nodes.sources.play_range import PlayRange
    from nanorocks_ros.recordings.bag.reader import BagMessage
    from nanorocks_ros.records import Frame
    from nanorocks_ros.settings import PacingSettings


def recorded_moments(
    bag: BagFrames, play_range: PlayRange
) -> Iterator[tuple[int, tuple[Frame | FrameError, BagMessage]]]:
    """Log time [ns], frame and its message, of each frame of the range.

    In the place of an unusable frame stands the error.
    """
    for first_ns in play_range.starts():
        for message, frame in bag.recorded_frames(first_ns, play_range.last_ns):
            yield message.log_time_ns, (frame, message)


def refuse_unused_parameters(source: str, bag: BagSettings, pacing: PacingSettings) -> None:
    """Refuse parameters that choose a bag, or a part of it, when no bag is played.

    A parameter file may serve the whole graph, also a player beside this node, so it may hold
    them. But a bag together with a simulation is a mistake also there.

    Parameters
    ----------
    source : str
        ``simulator``, ``bag`` or ``topic``.
    bag : BagSettings
    pacing : PacingSettings

    Raises
    ------
    ConfigurationError
    """
    if source == 'bag':
        return
    changed = [
        name for name, value in asdict(bag).items() if value != getattr(BagSettings(), name)
    ]
    if source == 'topic' and pacing.duration > 0.0:
        changed.append('duration')
    refused = {*command_line_parameters(), *(('bag',) if source == 'simulator' else ())}
    for name in changed:
        if name in refused:
            raise ConfigurationError(
                f'parameter {name}',
                f'given, but source is {source}',
                'set source:=bag, or leave it out',
            )


def settings_of_bag(node: Node, bag: BagSettings) -> PipelineSettings:
    """Default settings for a bag: what it says of its trays; what is told to the node is noted.

    Parameters
    ----------
    node : rclpy.node.Node
        Its overrides are what is told; notices go to its log.
    bag : BagSettings

    Raises
    ------
    ConfigurationError
        When the path is empty, or what is told cannot be used.
    RecordingError
        When the bag cannot be read, or what it says of its trays cannot be used.
    """
    path = path_of_bag(bag)
    completed = completed_settings(node, read_metadata(path), path)
    for notice in completed.notices:
        node.get_logger().warning(notice)
    return completed.settings


def path_of_bag(settings: BagSettings) -> str:
    """The path of the bag.

    Raises
    ------
    ConfigurationError
        When it is empty.
    """
    if not settings.bag:
        raise ConfigurationError('parameter bag', 'is empty', 'give the path of a bag')
    return settings.bag


def open_bag_frames(settings: BagSettings) -> BagFrames:
    """Open the bag to read its camera.

    Raises
    ------
    ConfigurationError
        When the path is empty.
    RecordingError
        When the bag cannot be used.
    """
    return BagFrames(path_of_bag(settings))
