"""Which stages a change of settings concerns: the others go on with their running cycle."""

from __future__ import annotations

from dataclasses import fields
from enum import Flag, auto
from operator import attrgetter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.settings import PipelineSettings


class Part(Flag):
    """Parts of the pipeline, each with stages that restart together."""

    IMAGES = auto()
    """The tray images, and with them everything."""
    MEASUREMENT = auto()
    """Tracks, contacts, bodies and speeds."""
    CLUSTERS = auto()
    RESTITUTION = auto()


# Groups of settings that only these parts read; every other group changes the images, or is read
# by several stages.
_READ_BY = {
    'bodies': Part.MEASUREMENT,
    'clusters': Part.CLUSTERS,
    'sticking': Part.CLUSTERS | Part.RESTITUTION,
    'cooling': Part.RESTITUTION,
    'prior': Part.RESTITUTION,
}
# Settings of these groups that the measurement reads as well.
_ALSO_MEASURED = ('prior.drag', 'prior.drag_error', 'cooling.rebounds', 'cooling.collisions')


def changed_parts(before: PipelineSettings, after: PipelineSettings) -> Part:
    """The parts that read a setting in which two sets differ.

    Parameters
    ----------
    before, after : PipelineSettings
    """
    parts = Part(0)
    for name in _differing(before, after, (item.name for item in fields(before))):
        parts |= _READ_BY.get(name, Part.IMAGES)
    if any(_differing(before, after, _ALSO_MEASURED)):
        parts |= Part.MEASUREMENT
    return parts


def _differing(
    before: PipelineSettings, after: PipelineSettings, names: Iterable[str]
) -> list[str]:
    """The names of settings or groups that differ."""
    return [name for name in names if attrgetter(name)(before) != attrgetter(name)(after)]
