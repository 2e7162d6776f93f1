"""Errors of the paper in what it says of the restitution, by its own numbers.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math

from nanorocks_ros.experiment import paper_values as reported
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.html_report import Erratum
from nanorocks_ros.physics.confined_theory import confined_gas
from nanorocks_ros.physics.paper_formulas import (
    paper_restitution,
    paper_restitution_of_decay,
    paper_wall_ellipse,
)

_TRAY = 1
# Restitution of the decay to which the closed form of the paper is applied.
_EXAMPLE = 0.8


def _rate() -> float:
    """Decay rate 1/(v0 tau) of the mean projected speed in figure 7, [1/m]."""
    relative = math.sqrt(2.0 * reported.PAPER_ENERGY / reported.PAPER_MASS)
    return 1.0 / (0.5 * relative * reported.PAPER_HAFF_TIME)


def restitution_errata() -> list[Erratum]:
    """Its closed form and its wall ellipse."""
    tray = load_trays()[_TRAY]
    decay = (
        reported.PAPER_ENERGY,
        reported.PAPER_HAFF_TIME,
        reported.PAPER_MASS,
        tray.diameter,
        tray.number_density,
    )
    gas, walls = confined_gas(tray), reported.PAPER_WALL_RESTITUTION
    rate = _rate()
    expected = gas.decay_rate(reported.PAPER_RESTITUTION, walls)
    by_closed_form = paper_restitution_of_decay(
        gas.decay_rate(_EXAMPLE, walls), tray.diameter, tray.number_density
    )
    ellipse = paper_wall_ellipse(*decay, max(tray.dimensions))
    printed = reported.PAPER_ELLIPSE
    return [
        Erratum(
            text='Its closed form loses a factor of 2 between the loss of energy and the decay '
            'time, assumes a dilute gas in a large box, and in its first form neglects the walls, '
            'which take more energy than the beads in tray 1. Applied to the decay of the kinetic '
            f'theory between walls for a restitution of {_EXAMPLE:g}, it gives '
            f'{by_closed_form:.2f}. Its worked example gives {paper_restitution(*decay):.3f} as '
            f'printed, from a decay rate of {rate:.0f} /m, {rate / expected:.1f} times that of a '
            'gas with such beads and walls. Beads that stick cool as fast, and so do beads that '
            'rub on floor and lid.'
        ),
        Erratum(
            text=f'The axes of its wall ellipse are printed as a = {printed[0]:g}, b = '
            f'{printed[1]:g}; its own formula gives a = {ellipse.wall_axis:.3f}, b = '
            f'{ellipse.bead_axis:.3f}. It takes the walls 15 mm apart, the sides of the cell, '
            'where floor and lid leave the centres of the beads 1 mm.'
        ),
    ]
