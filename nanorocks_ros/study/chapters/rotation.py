"""Rotation: whether it widens the restitutions below 5 mm/s, or noise does."""

from __future__ import annotations

from nanorocks_ros.study.chapters.context import Chapter, Context
from nanorocks_ros.study.report import Erratum, Section


def rotation_chapter(context: Context) -> Chapter:
    """What the camera could see of rotation."""
    context.progress(1.0)
    section = Section(
        title='Rotation',
        parts=[
            Erratum(
                text='The paper takes the wider spread of its restitutions below 5 mm/s for '
                'energy from rotation. With 0.1 mm/s of noise and no rotation at all the spread '
                'widens just so (the band of Figure 13). In equipartition a bead of 1 mm at 1 '
                'mm/s turns by about 90 degrees in a second, not by 0.1. docs/rotation.md works '
                'it out with rough beads.'
            )
        ],
    )
    return Chapter(section=section)
