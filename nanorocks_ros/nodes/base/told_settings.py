"""What is told to a node of its pipeline, and what the trays file that is told says of its film.

Tested by ``test/nodes/test_contacts_live.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nanorocks_ros.experiment.recorded_experiment import recorded_settings
from nanorocks_ros.settings import PipelineSettings, rows, with_current_names, with_values

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rclpy.node import Node

    from nanorocks_ros.experiment.recorded_experiment import RecordedSettings


def told_settings(node: Node) -> dict[str, Any]:
    """Settings of the pipeline by name that are told to a node.

    Raises
    ------
    ConfigurationError
        For two names of one setting.
    """
    defaults = PipelineSettings()
    given = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
    names = {row.name for row in rows(defaults)}
    told, _ = with_current_names(defaults, given, f'node {node.get_name()}')
    return {name: value for name, value in told.items() if name in names}


def completed_settings(
    node: Node, metadata: Mapping[str, str], recording: str
) -> RecordedSettings:
    """What is told to a node, completed by its trays file and by what a recording says.

    Raises
    ------
    ConfigurationError
        When what is told cannot be used.
    RecordingError
        When what the recording says cannot be used.
    """
    told = told_settings(node)
    settings = with_values(PipelineSettings(), told, f'node {node.get_name()}')
    return recorded_settings(settings, told.keys(), metadata, recording)


def default_settings(node: Node) -> PipelineSettings:
    """Defaults of a node: those of its trays file, where it tells of its film.

    Raises
    ------
    ConfigurationError
        When what is told cannot be used.
    """
    if not told_settings(node).get('trays_file'):
        return PipelineSettings()
    return completed_settings(node, {}, f'node {node.get_name()}').settings
