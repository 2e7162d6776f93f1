"""Lines of equal decay rate across the map of a sweep, by closed forms.

Tested by ``test/studies/decays/test_chi_square_map.py``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.inference.decay.haff_fit import fit_haff
from nanorocks_ros.physics.confined_theory import ConfinedGas, confined_gas
from nanorocks_ros.physics.paper_formulas import paper_wall_ellipse_of_decay

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.decays.decay_curve import SpeedCurve
    from nanorocks_ros.studies.sweeps.sweep_result import Sweep

_BEADS, _WALLS, _WIDTH = 'restitution', 'wall_restitution', 'restitution_width'
_STEPS = 101
# Before this time the decay depends on the initial velocities [s].
_START = 1.75
# Relative error of speeds whose error is not known.
_DEFAULT_ERROR = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Contour:
    """A line across the map of a sweep.

    Parameters
    ----------
    label : str
    restitution, other : ndarray (n,)
        Restitution between beads, and the value along the other axis; NaN where the closed form
        has no solution.
    """

    label: str
    restitution: NDArray[np.float64]
    other: NDArray[np.float64]


def contours(sweep: Sweep, curve: SpeedCurve) -> tuple[Contour, ...]:
    """Lines along which closed forms give the decay rate of a curve.

    One by the confined theory for the decay rate of the curve, one by the ellipse of the paper.

    Parameters
    ----------
    sweep : Sweep
        Over the restitution between beads, and that of the walls or the width of the
        distribution.
    curve : SpeedCurve

    Returns
    -------
    tuple of Contour
        Empty where the closed forms do not hold: other axes, beads that stick or are rough, a
        tray too dense, or a curve that does not fall.
    """
    plan = json.loads(sweep.specification)
    settings = plan['settings']
    names = {axis.name for axis in sweep.axes}
    other_name = next(iter(names - {_BEADS}), '')
    smooth = settings['tangential_restitution'] == settings['wall_tangential_restitution'] == -1.0
    no_sticking = settings['sticking_speed'] == settings['wall_sticking_speed'] == 0.0
    if names not in ({_BEADS, _WALLS}, {_BEADS, _WIDTH}) or not (smooth and no_sticking):
        return ()
    tray = tray_by_number(load_trays(), settings['tray'])
    try:
        rate = reference_rate(sweep, curve, tray)
        gas = confined_gas(tray)
    except (ConfigurationError, FitError):
        return ()
    (axis,) = (axis for axis in sweep.axes if axis.name == other_name)
    ends = [float(value) for value in axis.values]
    values = np.linspace(min(ends), max(ends), _STEPS)
    if other_name == _WALLS:
        fixed = float(settings[_WIDTH])
        theory = [_restitution(gas, rate, float(value), fixed) for value in values]
    else:
        fixed = float(settings[_WALLS])
        theory = [_restitution(gas, rate, fixed, float(value)) for value in values]
    ellipse = _paper(tray, rate, values if other_name == _WALLS else np.ones_like(values))
    return (
        Contour(
            label=f'confined theory, {rate:.3g} /m', restitution=np.array(theory), other=values
        ),
        Contour(label="the paper's ellipse", restitution=ellipse, other=values),
    )


def _restitution(gas: ConfinedGas, rate: float, walls: float, width: float) -> float:
    try:
        return gas.restitution(rate, walls, width)
    except FitError:
        return float('nan')


def _paper(tray: Tray, rate: float, walls: NDArray[np.float64]) -> NDArray[np.float64]:
    try:
        ellipse = paper_wall_ellipse_of_decay(
            rate, tray.diameter, tray.number_density, tray.dimensions[0]
        )
    except FitError:
        return np.full(walls.size, np.nan)
    return np.array([ellipse.restitution(float(wall)) for wall in walls])


def reference_rate(sweep: Sweep, curve: SpeedCurve, tray: Tray) -> float:
    """Decay rate 1 / (v0 tau) [1/m] of a curve, fitted from 1.75 s after the shaking event on.

    Parameters
    ----------
    sweep : Sweep
        Gives the number of runs of a curve without a number of cycles.
    curve : SpeedCurve
    tray : Tray

    Raises
    ------
    FitError
        When the speeds do not fall, or are fewer than 4.
    """
    late = (curve.times >= _START) & (curve.speed > 0.0)
    speed, error = curve.speed[late], curve.error[late]
    error = np.where(error > 0.0, error, _DEFAULT_ERROR * speed)
    beads = tray.count * (curve.cycles or sweep.runs)
    return fit_haff(curve.times[late], speed, error, beads).decay_rate
