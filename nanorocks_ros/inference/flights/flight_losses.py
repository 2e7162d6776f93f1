"""Drag of the gas, friction and residual acceleration, from the bends of free flights.

Between contacts a bead in a gas at low pressure has the acceleration a - drag v (Stokes), so that
over all flights the bend against the velocity gives the drag, and its mean the acceleration. Both
are fitted together by weighted least squares. A flight with a weak kink, from a glancing hit that
was not seen, is bent by it: flights whose positions leave a parabola are left out, and far ones of
the rest count less (Huber). Errors follow from the scatter of the flights (sandwich), so that they
hold where those of the positions are too small.

Floor and lid that rub slow a bead at each hit, on average by a deceleration that follows the
vertical speeds, whatever the horizontal speed of the bead: friction rate times granular
temperature. A second fit holds both: drag is told from it by the speeds of the beads, and by how
it stays while the gas cools.

The drag of other species over that of the first goes by their densities and measured sizes. What
is wrong with these is wrong with the drag of the first, as far as flights of others tell it, and
not with what slows the others.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from nanorocks_ros.records import UNKNOWN_MEASURED, FreeFlight, Measured, MeasuredInterval

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

MIN_FLIGHTS = 12
"""Smallest number of flights for a fit."""

# Columns: velocity (2), acceleration (2), its error, positions, drag over that of the first
# species, reduced chi square, granular temperature, species.
_COLUMNS = 10
# Undetected kinks bend long flights more than errors of positions do, in proportion to a power of
# the number of positions; at this number they do half as much.
_KINK_POINTS, _KINK_SHARE, _KINK_POWER = 48.0, 0.5, 1.5
# Largest chi square of a parabola over the median of all, and where the weight begins to fall.
_MAX_CHI_SQUARE, _HUBER = 2.4, 2.0
# Slower beads say nothing of drag, and hardly move in the picture, [m/s].
_MIN_SPEED = 1e-4
_ROUNDS, _CONVERGED = 20, 1e-3
# Median of the length of a two-dimensional Gaussian vector of unit variance.
_MEDIAN_LENGTH = 1.1774
# Errors by which an acceleration differs from 0: chance does so once in 500 cycles.
_SIGMAS = 3.5
# Standard deviations on each side, and points, of the grid of drags and friction rates.
_REACH, _GRID = 5.0, 101
# Relative error of the drag of another species over that of the first: measured radii of beads of
# some pixels are up to 10 % large (glass with highlights), and densities of a kind of glass differ
# by 4 %. In films of tray 3 drags came out up to 20 % high (`benchmarks.friction_films`).
_RATIO_ERROR = 0.1
# Errors beside friction are larger than by the scatter: beads roll, and hits are single events.
# With frictions of 0.01 and 0.03 drags scattered by 2 to 2.6 times that, when it was measured.
_RUBBED_ERRORS = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Slowing:
    """What slows beads between contacts.

    Parameters
    ----------
    values : ndarray (2,)
        Drag of the gas on beads of the first species, [1/s], and friction rate, [1/m]:
        deceleration over granular temperature.
    covariance : ndarray (2, 2)
    """

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @classmethod
    def by_drag(cls, drag: Measured) -> Slowing:
        """A gas between floor and lid without friction."""
        return cls(values=np.array([drag.value, 0.0]), covariance=np.diag([drag.error**2, 0.0]))

    @property
    def drag(self) -> Measured:
        """Drag of the gas, [1/s]."""
        return Measured(float(self.values[0]), math.sqrt(max(self.covariance[0, 0], 0.0)))

    def beside_friction(self, rate: float, error: float) -> tuple[Measured, float]:
        """The drag beside a friction rate, and the log likelihood of that rate, 0 at best.

        Both slow a bead, so that the flights leave the less drag the more friction there is.

        Parameters
        ----------
        rate, error : float, [1/m]
        """
        if not self.covariance[1, 1] > 0.0:
            # No flights tell it.
            return self.drag, 0.0
        variance = float(self.covariance[1, 1]) + error**2
        gain, off = float(self.covariance[0, 1]) / variance, rate - float(self.values[1])
        rest = float(self.covariance[0, 0]) - gain * float(self.covariance[0, 1])
        drag = Measured(float(self.values[0]) + gain * off, math.sqrt(max(rest, 0.0)))
        return drag, -0.5 * (off**2 / variance + math.log(variance / self.covariance[1, 1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightLosses:
    """What changes the velocity of beads between their contacts.

    Parameters
    ----------
    drag : Measured, [1/s]
        Rate at which the gas slows a bead of the first species; may come out below 0 by chance.
    acceleration : ndarray (2,), [m/s^2]
        Common to all beads.
    covariance : ndarray (2, 2)
        Of the acceleration; NaN while unknown.
    flights : int
        Number of flights used.
    rubbed : Slowing
        Drag and friction rate, where both may be; neither is below 0.
    fitted : Slowing
        The same as the flights tell them, also below 0.
    ratio_error : float
        Relative error of the drag of the first species by what its ratio to the others is taken to
        be. It changes nothing of how these are slowed, and is in no other error.
    """

    drag: Measured = UNKNOWN_MEASURED
    acceleration: NDArray[np.float64]
    covariance: NDArray[np.float64]
    flights: int = 0
    rubbed: Slowing
    fitted: Slowing
    ratio_error: float = 0.0

    def of_first_species(self, drag: Measured) -> Measured:
        """A drag by flights of all species as that of the first, with the error of the ratio."""
        return Measured(drag.value, math.hypot(drag.error, self.ratio_error * drag.value))

    @property
    def slowing(self) -> Slowing:
        """The drag as what slows beads without friction: a gas does not speed them up.

        The error stays: a drag that came out below 0 is no better known.
        """
        return Slowing.by_drag(Measured(max(self.drag.value, 0.0), self.drag.error))

    @property
    def is_accelerated(self) -> bool:
        """Whether the acceleration is not 0."""
        if not np.isfinite(self.covariance).all():
            return False
        square = self.acceleration @ np.linalg.solve(self.covariance, self.acceleration)
        return bool(square > _SIGMAS**2)

    def magnitude(self, probability: float) -> MeasuredInterval:
        """Size of the acceleration in the image plane, for a flat prior of both components.

        Parameters
        ----------
        probability : float
            Of the interval.
        """
        size = float(np.hypot(*self.acceleration))
        error = math.sqrt(0.5 * float(np.trace(self.covariance)))
        if not math.isfinite(error):
            return MeasuredInterval()
        lower, upper = (
            error * math.sqrt(float(special.chndtrix(p, 2.0, (size / error) ** 2)))
            for p in (0.5 - 0.5 * probability, 0.5 + 0.5 * probability)
        )
        return MeasuredInterval(size, error, lower, upper)


def flight_table(flights: Iterable[FreeFlight]) -> NDArray[np.float64]:
    """What the fit needs of flights, (n, 10); tables of more flights are concatenated."""
    rows = [
        (
            *flight.mean_velocity.tolist(),
            *flight.mean_acceleration.tolist(),
            flight.acceleration_error,
            flight.points,
            flight.relative_drag,
            flight.reduced_chi_square,
            flight.temperature,
            flight.species,
        )
        for flight in flights
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, _COLUMNS)


def flight_losses(table: NDArray[np.float64], prior: Measured) -> FlightLosses:
    """Drag and acceleration from flights.

    Parameters
    ----------
    table : ndarray (n, 10)
        From `flight_table`.
    prior : Measured, [1/s]
        Of the drag: mean and standard deviation, 0 where it is known.

    Returns
    -------
    FlightLosses
        With the prior alone from fewer than `MIN_FLIGHTS` flights, and without an error from
        none: where beads are not tracked the drag is taken to be as given.
    """
    used = _usable(table)
    unknown = np.full(2, math.nan), np.full((2, 2), math.nan)
    if len(used) < MIN_FLIGHTS:
        drag = prior if len(table) else Measured(prior.value, 0.0)
        return FlightLosses(
            drag=drag,
            acceleration=unknown[0],
            covariance=unknown[1],
            rubbed=Slowing.by_drag(drag),
            fitted=Slowing.by_drag(drag),
        )
    design = _design(used)
    fit, covariance = _with_prior(*_robust_fit(used, design[:, :, :3]), prior)
    both, errors = _with_prior(*_robust_fit(used, design), prior)
    fitted = Slowing(
        values=both[[0, 3]], covariance=_RUBBED_ERRORS**2 * errors[np.ix_([0, 3], [0, 3])]
    )
    return FlightLosses(
        drag=Measured(float(fit[0]), math.sqrt(max(float(covariance[0, 0]), 0.0))),
        acceleration=fit[1:],
        covariance=covariance[1:, 1:],
        flights=len(used),
        rubbed=_not_below_zero(fitted.values, fitted.covariance),
        fitted=fitted,
        ratio_error=_RATIO_ERROR * _share_of_others(used, design),
    )


def _share_of_others(flights: NDArray[np.float64], design: NDArray[np.float64]) -> float:
    """Which part of what flights tell of the drag is told by other species than the first."""
    told = (design[:, :, 0] ** 2).sum(axis=1) / _errors(flights) ** 2
    return float(told[flights[:, 9] != 0].sum() / told.sum())


def _not_below_zero(fit: NDArray[np.float64], covariance: NDArray[np.float64]) -> Slowing:
    """Mean and covariance of drag and friction rate, neither of which can speed beads up.

    In a cycle they compensate each other to nine tenths: without this limit a drag far below 0
    makes up for a friction rate twice too high.
    """
    spreads = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if spreads[0] == 0.0:
        # The drag is known.
        return Slowing(values=fit, covariance=covariance)
    axes = [
        np.linspace(max(middle - _REACH * spread, 0.0), max(middle, 0.0) + _REACH * spread, _GRID)
        for middle, spread in zip(fit, spreads, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing='ij'), axis=-1).reshape(-1, 2)
    off = points - fit
    depth = 0.5 * np.einsum('ni,ni->n', off, np.linalg.solve(covariance, off.T).T)
    weight = np.exp(depth.min() - depth)
    weight /= weight.sum()
    mean = weight @ points
    off = points - mean
    return Slowing(values=mean, covariance=(weight[:, np.newaxis] * off).T @ off)


def drag_of_flights(table: NDArray[np.float64], prior: Measured) -> Measured:
    """The drag of `flight_losses` alone, in half the time."""
    used = _usable(table)
    if len(used) < MIN_FLIGHTS:
        return prior
    fit, covariance = _with_prior(*_robust_fit(used, _design(used)[:, :, :3]), prior)
    return Measured(float(fit[0]), math.sqrt(max(float(covariance[0, 0]), 0.0)))


def _design(flights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives of accelerations, (n, 2, 4), by drag, both accelerations and friction rate."""
    design = np.zeros((len(flights), 2, 4))
    velocity = flights[:, :2]
    design[:, :, 0] = -velocity * flights[:, 6, np.newaxis]
    design[:, 0, 1] = design[:, 1, 2] = 1.0
    direction = velocity / np.hypot(*velocity.T)[:, np.newaxis]
    design[:, :, 3] = -direction * flights[:, 8, np.newaxis]
    return design


def _with_prior(
    fit: NDArray[np.float64], covariance: NDArray[np.float64], prior: Measured
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A fit and its covariance with the prior of the drag, and what it tells about the rest."""
    gain = covariance[:, 0] / (covariance[0, 0] + prior.error**2)
    return fit + gain * (prior.value - fit[0]), covariance - np.outer(gain, covariance[0])


def _usable(table: NDArray[np.float64]) -> NDArray[np.float64]:
    """Flights fast enough to be slowed visibly, and as smooth as a parabola."""
    moving = table[(np.hypot(table[:, 0], table[:, 1]) > _MIN_SPEED) & (table[:, 8] > 0.0)]
    if not len(moving):
        return moving
    chi_square = moving[:, 7]
    return moving[chi_square <= _MAX_CHI_SQUARE * np.median(chi_square)]


def _errors(flights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of the accelerations, with what unseen kinks do."""
    kinks = _KINK_SHARE * (flights[:, 5] / _KINK_POINTS) ** _KINK_POWER
    return np.asarray(flights[:, 4] * np.hypot(1.0, kinks))


def _robust_fit(
    flights: NDArray[np.float64], design: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parameters of the accelerations of flights, (k,), and their covariance, (k, k).

    `design`, (n, 2, k), holds the derivatives of both accelerations by the parameters.
    """
    measured = flights[:, 2:4]
    error = _errors(flights)
    trust = np.ones(len(flights))
    for _ in range(_ROUNDS):
        weight = trust / error**2
        normal = np.einsum('n,nci,ncj->ij', weight, design, design)
        fit = np.linalg.solve(normal, np.einsum('n,nci,nc->i', weight, design, measured))
        rest = measured - design @ fit
        length = np.hypot(*rest.T) / error
        scale = float(np.median(length)) / _MEDIAN_LENGTH
        before, trust = trust, np.minimum(1.0, _HUBER * scale / np.maximum(length, 1e-12))
        if np.abs(trust - before).max() < _CONVERGED:
            break
    inverse = np.linalg.inv(normal)
    # Residuals of a fit without the flight itself: a few long flights decide.
    hat = np.einsum('n,nci,ij,ndj->ncd', weight, design, inverse, design)
    rest = np.linalg.solve(np.eye(2) - hat, rest[:, :, np.newaxis])[:, :, 0]
    scores = np.einsum('n,nci,nc->ni', weight, design, rest)
    return fit, inverse @ (scores.T @ scores) @ inverse
