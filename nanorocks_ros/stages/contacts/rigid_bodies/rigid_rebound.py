"""Fit of a body of several beads that rebounds from a side wall, in the projection of the camera.

Before and after the contact the body moves freely: its centre on a straight line, its beads about
it with a constant angular momentum. The impulse of a smooth wall passes through the centre of the
bead that touches, so that mass and tensor of inertia turn it into both changes of velocity, and
the normal speed of the wall contact is that of the centre of that bead. Heights of beads are not
seen; they are fitted with the spread that the tray allows.

Tested by ``test/stages/contacts/test_body_rebounds.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from nanorocks_ros.stages.contacts.rigid_bodies.rebound_residuals import (
    SeenBody,
    arms_of,
    derivatives_of,
    residuals_of,
)
from nanorocks_ros.stages.contacts.rigid_bodies.rigid_motion import after_impulse

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Typical changes of the unknowns: places [m], velocities [m/s], spins [rad/s], times [s].
_PLACE, _VELOCITY, _SPIN, _TIME = 1e-5, 1e-4, 0.1, 1e-2
# Evaluations per unknown after which a fit is given up.
_EVALUATIONS = 25
# Steps of numerical derivatives, in typical changes.
_STEP = 1e-3
# Least height between two beads, over their distance, from which a fit begins.
_LEAST_HEIGHT = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFrames:
    """A body in some frames around its contact with a side wall.

    Parameters
    ----------
    times : ndarray (n,), [s]
    positions : ndarray (n, m, 2), [m]
        Of the beads in the tray, which is at rest or moves on a straight line; 0 where hidden.
    errors : ndarray (n, m), [m]
        Infinite where a bead is hidden.
    masses, radii : ndarray (m,), [kg], [m]
    bead : int
        That touches the wall.
    axis : int
        Of the normal of the wall.
    outward : float
        1 for the high wall, -1 for the low one.
    spread : float, [m]
        Standard deviation of the heights of beads about their mean.
    noise : float
        Variance of positions about flights over that by the errors: where these are too large a
        misfit shows in less.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    errors: NDArray[np.float64]
    masses: NDArray[np.float64]
    radii: NDArray[np.float64]
    bead: int
    axis: int
    outward: float
    spread: float
    noise: float = 1.0

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector from the wall into the tray, (3,)."""
        normal = np.zeros(3)
        normal[self.axis] = -self.outward
        return normal


class RigidRebound(NamedTuple):
    """A rebound of a body.

    Parameters
    ----------
    time : float, [s]
        Of the contact.
    position : ndarray (2,), [m]
        Of the bead that touches, then.
    incoming, outgoing : float, [m/s]
        Normal speeds of the contact, before and after.
    errors : ndarray (2,), [m/s]
        Of both, reduced by what they have in common: those of their ratio near 1.
    tangential : float, [m/s]
        Velocity of the centre of mass along the wall.
    excess : float
        Of chi square over its expected value, in standard deviations.
    """

    time: float
    position: NDArray[np.float64]
    incoming: float
    outgoing: float
    errors: NDArray[np.float64]
    tangential: float
    excess: float


class _Motion(NamedTuple):
    """A body at its contact, and its velocities."""

    centre: NDArray[np.float64]
    arms: NDArray[np.float64]
    velocity: NDArray[np.float64]
    spin: NDArray[np.float64]
    impulse: float
    time: float


def rigid_rebound(frames: BodyFrames, first: int) -> RigidRebound | None:
    """Fit a rebound; None where the fit fails or is not determined.

    Parameters
    ----------
    frames : BodyFrames
    first : int
        Row of the first frame after the contact.
    """
    fit = _Fit(frames, first)
    try:
        solution = least_squares(
            fit.residuals, fit.start, jac=fit.derivatives, x_scale=fit.scale, method='lm',
            max_nfev=_EVALUATIONS * fit.start.size,
        )  # fmt: skip
    except (ValueError, np.linalg.LinAlgError):
        return None
    freedom = fit.freedom
    if freedom <= 0 or not np.isfinite(solution.x).all():
        return None
    motion = fit.motion(solution.x)
    gradient = fit.speed_gradient(solution.x)
    information = solution.jac.T @ solution.jac
    covariance = gradient @ np.linalg.pinv(information) @ gradient.T
    variances = np.diag(covariance)
    # The ratio of both speeds, near 1, has the variance of their difference.
    shared = max(variances.sum() - 2.0 * covariance[0, 1], 0.0) / variances.sum()
    incoming, outgoing = fit.speeds(solution.x).tolist()
    return RigidRebound(
        time=motion.time,
        position=motion.centre + motion.arms[frames.bead, :2],
        incoming=incoming,
        outgoing=outgoing,
        errors=np.sqrt(shared * variances),
        tangential=float(motion.velocity[1 - frames.axis]),
        excess=(fit.chi_square(solution.x) / frames.noise - freedom) / math.sqrt(2.0 * freedom),
    )


def _seen_body(frames: BodyFrames, first: int) -> SeenBody:
    """What some frames tell of a body that touches the wall before the row `first`."""
    return SeenBody(
        times=frames.times,
        first=first,
        positions=frames.positions,
        weights=1.0 / frames.errors,
        shares=frames.masses / frames.masses.sum(),
        radii=frames.radii,
        bead=frames.bead,
        normal=frames.normal,
        spread=frames.spread,
        bond=float(frames.radii.sum()) if frames.radii.size == 2 else math.nan,
    )


class _Fit:
    """Residuals of a body that rebounds between two frames; see `rebound_residuals`."""

    def __init__(self, frames: BodyFrames, first: int) -> None:
        self._frames = frames
        self._body = _seen_body(frames, first)
        self._shares, self._bond = self._body.shares, self._body.bond
        places = np.full(3 * frames.masses.size, _PLACE)
        changes = [_VELOCITY] * 2 + [_SPIN] * 3 + [_VELOCITY, _TIME]
        self.scale = np.concatenate([places, changes])
        self.start = self._start(frames.times[first - 1 : first + 1].mean())

    @property
    def freedom(self) -> int:
        """Degrees of freedom: of the heights, the prior knows as much as there is to know."""
        beads = self._frames.masses.size
        heights = beads - 1 if math.isnan(self._bond) else 0
        return int(2 * np.count_nonzero(self._body.weights) - (2 * beads + 7 + heights))

    def motion(self, unknowns: NDArray[np.float64]) -> _Motion:
        """The body by the unknowns of the fit."""
        centre, arms = arms_of(unknowns, self._shares)
        rest = unknowns[3 * self._frames.masses.size :]
        return _Motion(centre, arms, rest[:2], rest[2:5], float(rest[5]), float(rest[6]))

    def _after(self, motion: _Motion) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Velocity and spin after the impulse of the wall."""
        frames = self._frames
        turning = self._shares, frames.radii, frames.bead, self._body.normal
        return after_impulse(motion.arms, motion.velocity, motion.spin, motion.impulse, turning)

    def _bead_velocity(
        self, arm: NDArray[np.float64], velocity: NDArray[np.float64], spin: NDArray[np.float64]
    ) -> float:
        """Velocity of the centre of a bead along the normal into the tray, [m/s]."""
        turning = spin[1] * arm[2] - spin[2] * arm[1], spin[2] * arm[0] - spin[0] * arm[2]
        axis = self._frames.axis
        return float(velocity[axis] + turning[axis]) * float(self._body.normal[axis])

    def speeds(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normal speeds of the contact before and after, (2,), [m/s]."""
        motion = self.motion(unknowns)
        arm = motion.arms[self._frames.bead]
        before = self._bead_velocity(arm, motion.velocity, motion.spin)
        return np.array([-before, self._bead_velocity(arm, *self._after(motion))])

    def speed_gradient(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of both speeds by the unknowns, (2, u)."""
        columns = []
        for number, change in enumerate(self.scale * _STEP):
            step = np.zeros(unknowns.size)
            step[number] = change
            difference = self.speeds(unknowns + step) - self.speeds(unknowns - step)
            columns.append(difference / (2.0 * change))
        return np.column_stack(columns)

    def residuals(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Deviations of all positions, heights and the bond, in their errors."""
        return residuals_of(self._body, unknowns)

    def derivatives(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of the residuals by the unknowns."""
        return derivatives_of(self._body, unknowns, self.scale * _STEP)

    def chi_square(self, unknowns: NDArray[np.float64]) -> float:
        """Of the positions alone."""
        return float((self.residuals(unknowns)[: self._body.positions.size] ** 2).sum())

    def _start(self, time: float) -> NDArray[np.float64]:
        """First values of the unknowns, from straight lines through each bead."""
        (place, slope), (place_after, slope_after) = (
            self._lines(rows, time)
            for rows in (slice(0, self._body.first), slice(self._body.first, None))
        )
        places = 0.5 * (place + place_after)
        velocity = self._shares @ slope
        impulse = float((self._shares @ slope_after - velocity) @ self._body.normal[:2])
        heights, spin = self._heights_and_spin(places, slope - velocity)
        return np.concatenate([places.ravel(), heights, velocity, spin, [impulse, time]])

    def _lines(self, rows: slice, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Places at a time and velocities of each bead, both (m, 2)."""
        frames = self._frames
        fits = []
        for bead in range(frames.masses.size):
            used = np.isfinite(frames.errors[rows, bead])
            times, places = frames.times[rows][used] - time, frames.positions[rows][used, bead]
            terms = np.column_stack([np.ones(times.size), times])
            fits.append(np.linalg.lstsq(terms, places, rcond=None)[0])
        lines = np.array(fits)
        return lines[:, 0], lines[:, 1]

    def _heights_and_spin(
        self, places: NDArray[np.float64], drift: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Heights and spin that give the beads their velocities about the centre."""
        arms = places - self._shares @ places
        upright = np.column_stack([-arms[:, 1], arms[:, 0]])
        about_vertical = float((upright * drift).sum() / (arms**2).sum())
        rest = drift - about_vertical * upright
        if math.isnan(self._bond):
            # What is left is a product of heights and of one vector.
            heights = np.linalg.svd(rest)[0][:, 0]
            heights *= 0.5 * self._frames.spread * math.sqrt(heights.size)
        else:
            across = float(np.linalg.norm(places[1] - places[0]))
            square = max(self._bond**2 - across**2, (_LEAST_HEIGHT * self._bond) ** 2)
            heights = math.sqrt(square) * np.array([-0.5, 0.5])
        shear = heights @ rest / (heights @ heights)
        return heights, np.array([-shear[1], shear[0], about_vertical])
