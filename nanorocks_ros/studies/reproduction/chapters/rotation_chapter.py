"""Chapter on rotation: whether rotation or noise widens the restitutions below 5 mm/s.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math

from nanorocks_ros.experiment.paper_values import PAPER_ROTATION
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.html_report import Erratum, Section, Table, number
from nanorocks_ros.physics.rough_spheres import (
    rms_spin,
    rough_temperature_ratio,
    smooth_equivalent,
)
from nanorocks_ros.studies.reproduction.chapters.chapter_context import (
    Chapter,
    Context,
    Difference,
)

_SPEEDS = (1e-3, 5e-3, 1e-2)
_RATE = 30.0
_TRUTH = 0.89
_TANGENTIAL = (-0.5, 0.0, 0.5)


def rotation_chapter(context: Context) -> Chapter:
    """The effect of rotation on the decay, and its size in the images."""
    context.progress(1.0)
    diameter = load_trays()[1].diameter
    spins = [math.degrees(rms_spin(speed, diameter)) for speed in _SPEEDS]
    section = Section(
        title='Rotation',
        parts=[
            Table(
                head=('mean projected speed [mm/s]', 'spin in equipartition [degrees/s]',
                      'between two frames [degrees]'),
                rows=[
                    (f'{1e3 * speed:g}', number(spin), number(spin / _RATE, 2))
                    for speed, spin in zip(_SPEEDS, spins, strict=True)
                ],
                caption='Beads of tray 1. The rotation of round beads of one colour is invisible.',
            ),
            Table(
                head=('tangential restitution', 'rotational over translational temperature',
                      'restitution of smooth beads that cool alike'),
                rows=[
                    (f'{tangential:g}', number(rough_temperature_ratio(_TRUTH, tangential)),
                     number(smooth_equivalent(_TRUTH, tangential)))
                    for tangential in _TANGENTIAL
                ],
                caption=f'Rough beads of restitution {_TRUTH:g}, by kinetic theory, after the '
                'ratio has become constant: the restitution of rough beads that are taken for '
                'smooth ones is too low, equally at all speeds.',
            ),
            Erratum(
                text='The paper takes the wider spread of its restitutions below 5 mm/s for '
                'energy from rotation. Constant friction and tangential restitution define '
                'no speed at which rotation could begin. Noise of the mean speed explains the '
                'spread: the band of Figure 13 is without rotation and widens in the same way.'
            ),
        ],
    )  # fmt: skip
    row = Difference(
        'spin at 1 mm/s in equipartition [degrees/s]',
        f'{PAPER_ROTATION:g}',
        '',
        number(spins[0]),
        '',
    )
    finding = (
        f'Equipartition at 1 mm/s is a spin of {number(spins[0])} degrees/s, not '
        f'{PAPER_ROTATION:g}.'
    )
    return Chapter(section=section, differences=[row], findings=[finding])
