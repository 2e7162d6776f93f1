"""Closed forms of the restitution in [B19], for comparison.

They are precise and wrong: for simulated gases with restitutions from 0.6 to 0.95 the form for the
decay gives 0.94 to 0.99 (``docs/method/theory.md``). Errors cover statistics only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError
from nanorocks_ros.physics.error_propagation import Estimate, propagated
from nanorocks_ros.physics.kinetic_theory import check_positive

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The paper takes the speed in Haff's law to be the most probable relative speed of two
# beads, twice their mean speed ([B19] section 3.1.2).
RELATIVE_TO_MEAN_SPEED = 2.0


def paper_restitution(
    initial_energy: float,
    haff_time: float,
    mass: float,
    diameter: float,
    number_density: float,
) -> float:
    """Coefficient of restitution from the fit of Haff's law to the kinetic energy.

    Parameters
    ----------
    initial_energy : float, [J]
        T0 of the fit, the energy at the mean *relative* speed.
    haff_time : float, [s]
    mass : float, [kg]
        Mean mass of a bead.
    diameter : float, [m]
    number_density : float, [1/m^3]

    Returns
    -------
    float

    Raises
    ------
    ConfigurationError
        When a value is not positive and finite.
    FitError
        When the decay is faster than this form allows for a restitution of zero.

    References
    ----------
    [B19] section 3.1.2: sqrt(1 - sqrt(m/2) / (sigma n tau0 sqrt(T0))), sigma = pi d^2.
    """
    loss = _loss(initial_energy, haff_time, mass, diameter, number_density)
    if loss > 1.0:
        raise FitError(
            'paper_restitution',
            f'1 - restitution^2 would be {loss:.3g}',
            'this decay is faster than the closed form allows; check v0, tau and the tray',
        )
    return math.sqrt(1.0 - loss)


def paper_restitution_of_decay(decay_rate: float, diameter: float, number_density: float) -> float:
    """`paper_restitution` for the decay rate of the mean speed.

    Parameters
    ----------
    decay_rate : float, [1/m], > 0
        1 / (v0 tau) with v0 the mean projected speed of one bead.
    diameter : float, [m]
    number_density : float, [1/m^3]

    Returns
    -------
    float
        0 where the decay is faster than the form allows (a bound, not a measurement).

    References
    ----------
    [B19] eq. 5 with <v0> = 2 v0.
    """
    cross_section = math.pi * diameter**2
    loss = decay_rate / (RELATIVE_TO_MEAN_SPEED * cross_section * number_density)
    return math.sqrt(max(0.0, 1.0 - loss))


def _loss(
    initial_energy: float, haff_time: float, mass: float, diameter: float, number_density: float
) -> float:
    """The paper's 1 - restitution^2 for elastic walls."""
    check_positive(
        initial_energy=initial_energy,
        haff_time=haff_time,
        mass=mass,
        diameter=diameter,
        number_density=number_density,
    )
    cross_section = math.pi * diameter**2
    return math.sqrt(mass / 2.0) / (
        cross_section * number_density * haff_time * math.sqrt(initial_energy)
    )


def paper_restitution_estimate(
    initial_energy: Estimate | float,
    haff_time: Estimate | float,
    mass: Estimate | float,
    diameter: Estimate | float,
    number_density: Estimate | float,
) -> Estimate:
    """`paper_restitution` with the errors of its inputs, to first order.

    The error of the formula itself is not included.

    Raises
    ------
    ConfigurationError, FitError
        As `paper_restitution`, at the inputs or next to them.
    """
    return propagated(
        paper_restitution,
        initial_energy=initial_energy,
        haff_time=haff_time,
        mass=mass,
        diameter=diameter,
        number_density=number_density,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperEllipse:
    """Pairs of restitutions with the same decay in the paper, (ew/a)^2 + (ep/b)^2 = 1.

    Parameters
    ----------
    wall_axis : float
        Semi-axis a along the restitution of the walls.
    bead_axis : float
        Semi-axis b along the restitution between beads.
    """

    wall_axis: float
    bead_axis: float

    def restitution(self, wall_restitution: float) -> float:
        """Restitution between beads on the ellipse; NaN where it has none in [0, 1]."""
        square = 1.0 - (wall_restitution / self.wall_axis) ** 2
        restitution = self.bead_axis * math.sqrt(square) if square >= 0.0 else math.nan
        return restitution if restitution <= 1.0 else math.nan


def paper_wall_ellipse(
    initial_energy: float,
    haff_time: float,
    mass: float,
    diameter: float,
    number_density: float,
    side: float,
) -> PaperEllipse:
    """The paper's ellipse for a decay, with the axes that its formula gives.

    Valid as the paper's convention only. It uses the side of the cell, 15 mm, as the distance
    between walls, while the centres of beads have 1 mm between floor and lid, so that its wall
    losses are about 15 times too small.

    Parameters
    ----------
    initial_energy : float, [J]
    haff_time : float, [s]
    mass : float, [kg]
    diameter, side : float, [m]
    number_density : float, [1/m^3]

    Raises
    ------
    ConfigurationError
        When a value is not positive and finite.
    FitError
        When the decay is faster than the form allows.

    References
    ----------
    [B19] eq. e:ellipse: a = b sqrt(2 L sigma n),
    b = sqrt(1 + 1/(2 L sigma n) - sqrt(m/2) / (sigma n tau0 sqrt(T0))).
    """
    check_positive(side=side)
    loss = _loss(initial_energy, haff_time, mass, diameter, number_density)
    return _ellipse(loss, diameter, number_density, side)


def paper_wall_ellipse_as_printed(
    initial_energy: float,
    haff_time: float,
    mass: float,
    diameter: float,
    number_density: float,
    side: float,
) -> PaperEllipse:
    """The ellipse with a and b exchanged, as the paper prints their values (0.95 and 2.8)."""
    ellipse = paper_wall_ellipse(initial_energy, haff_time, mass, diameter, number_density, side)
    return PaperEllipse(wall_axis=ellipse.bead_axis, bead_axis=ellipse.wall_axis)


def paper_wall_ellipse_of_decay(
    decay_rate: float, diameter: float, number_density: float, side: float
) -> PaperEllipse:
    """The paper's ellipse for the decay rate 1 / (v0 tau) [1/m] of the mean projected speed.

    Raises
    ------
    ConfigurationError, FitError
        As `paper_wall_ellipse`.
    """
    check_positive(
        decay_rate=decay_rate, diameter=diameter, number_density=number_density, side=side
    )
    cross_section = math.pi * diameter**2
    loss = decay_rate / (RELATIVE_TO_MEAN_SPEED * cross_section * number_density)
    return _ellipse(loss, diameter, number_density, side)


def _ellipse(loss: float, diameter: float, number_density: float, side: float) -> PaperEllipse:
    paths = 2.0 * side * math.pi * diameter**2 * number_density
    square = 1.0 + 1.0 / paths - loss
    if square <= 0.0:
        raise FitError(
            'paper_wall_ellipse',
            f'the square of its axis would be {square:.3g}',
            'this decay is faster than the form allows; check v0, tau and the tray',
        )
    bead_axis = math.sqrt(square)
    return PaperEllipse(wall_axis=bead_axis * math.sqrt(paths), bead_axis=bead_axis)


def paper_instantaneous_restitution(
    speed: NDArray[np.float64],
    next_speed: NDArray[np.float64],
    interval: float,
    diameter: float,
    number_density: float,
) -> NDArray[np.float64]:
    """The paper's restitution between two measurements of the mean speed.

    exp(ln(v'/v) / (n sigma v dt)): every collision is assumed to multiply the speed of a bead by
    e. Haff's law has 1 - e^2 instead of -ln e, so the value differs from `paper_restitution` of
    the same decay; and the noise of the logarithm grows without bound for slow beads.

    Parameters
    ----------
    speed, next_speed : ndarray or float, [m/s]
        Mean speeds, an interval apart.
    interval : float, [s], > 0
    diameter : float, [m], > 0
    number_density : float, [1/m^3], > 0

    Returns
    -------
    ndarray
        Above 1 where the speed rises; NaN where one is not positive.

    Raises
    ------
    ConfigurationError
        When the interval, the diameter or the density is not positive and finite.

    References
    ----------
    [B19] eq. e:inst_cor, with an interval of 1/30 s.
    """
    check_positive(interval=interval, diameter=diameter, number_density=number_density)
    before, after = np.asarray(speed, dtype=np.float64), np.asarray(next_speed, dtype=np.float64)
    known = (before > 0.0) & (after > 0.0)
    before, after = np.where(known, before, np.nan), np.where(known, after, np.nan)
    collisions = number_density * math.pi * diameter**2 * before * interval
    # Limited to the range of a float: noise at rest has no bound.
    restitution: NDArray[np.float64] = np.exp(
        np.minimum(np.log(after / before) / collisions, 700.0)
    )
    return restitution
