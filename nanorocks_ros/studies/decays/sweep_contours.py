"""What closed forms say of a sweep: lines of one decay rate across its map."""

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
# Until then the initial velocities are still remembered.
_START = 1.75
# Errors of speeds that are not known, of the speed.
_UNKNOWN = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Contour:
    """A line across the map of a sweep.

    Parameters
    ----------
    label : str
    restitution, other : ndarray (n,)
        Restitution between beads, and the value along the other axis; NaN where there is none.
    """

    label: str
    restitution: NDArray[np.float64]
    other: NDArray[np.float64]


def contours(sweep: Sweep, curve: SpeedCurve) -> tuple[Contour, ...]:
    """Lines along which closed forms give the decay rate of a curve.

    Of the confined theory through the decay rate of the curve, and of the paper's ellipse.

    Parameters
    ----------
    sweep : Sweep
        Over the restitution between beads, and that of the walls or the width of the
        distribution; none are drawn over others.
    curve : SpeedCurve

    Returns
    -------
    tuple of Contour
        Empty where closed forms have nothing to say: other axes, beads that stick or are rough, a
        tray too crowded, or a curve that does not fall.
    """
    asked = json.loads(sweep.question)
    settings = asked['settings']
    names = {axis.name for axis in sweep.axes}
    other = next(iter(names - {_BEADS}), '')
    smooth = settings['tangential_restitution'] == settings['wall_tangential_restitution'] == -1.0
    free = settings['sticking_speed'] == settings['wall_sticking_speed'] == 0.0
    if names not in ({_BEADS, _WALLS}, {_BEADS, _WIDTH}) or not (smooth and free):
        return ()
    tray = tray_by_number(load_trays(), settings['tray'])
    try:
        rate = reference_rate(sweep, curve, tray)
        gas = confined_gas(tray)
    except (ConfigurationError, FitError):
        return ()
    (axis,) = (one for one in sweep.axes if one.name == other)
    ends = [float(value) for value in axis.values]
    values = np.linspace(min(ends), max(ends), _STEPS)
    if other == _WALLS:
        fixed = float(settings[_WIDTH])
        ours = [_restitution(gas, rate, float(value), fixed) for value in values]
    else:
        fixed = float(settings[_WALLS])
        ours = [_restitution(gas, rate, fixed, float(value)) for value in values]
    theirs = _paper(tray, rate, values if other == _WALLS else np.ones_like(values))
    return (
        Contour(label=f'confined theory, {rate:.3g} /m', restitution=np.array(ours), other=values),
        Contour(label="the paper's ellipse", restitution=theirs, other=values),
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
        Says how many runs a curve is a mean of that does not say so itself.
    curve : SpeedCurve
    tray : Tray

    Raises
    ------
    FitError
        When the speeds do not fall, or are fewer than 4.
    """
    late = (curve.times >= _START) & (curve.speed > 0.0)
    speed, error = curve.speed[late], curve.error[late]
    error = np.where(error > 0.0, error, _UNKNOWN * speed)
    beads = tray.count * (curve.cycles or sweep.runs)
    return fit_haff(curve.times[late], speed, error, beads).decay_rate
