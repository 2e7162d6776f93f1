"""Values of a restitution estimate that come from a fit of Haff's law.

Tested by ``test/stages/restitution/test_restitution_estimator.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.physics.paper_formulas import paper_restitution_of_decay
from nanorocks_ros.records import Measured

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.decay.haff_fit import HaffFit


def initial_speed(fit: HaffFit) -> Measured:
    """Initial speed with its error, [m/s]."""
    return Measured(fit.initial_speed, fit.initial_speed_error)


def haff_time(fit: HaffFit) -> Measured:
    """Haff time with its error, [s]."""
    return Measured(fit.haff_time, fit.haff_time_error)


def paper_restitution(rate: float, tray: Tray) -> float:
    """Restitution by the closed form of the paper, from the rate of a decay, [1/m]."""
    return paper_restitution_of_decay(rate, tray.diameter, tray.number_density)
