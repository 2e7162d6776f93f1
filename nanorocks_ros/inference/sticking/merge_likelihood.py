"""Likelihood of the merges of a cycle for a grid of sticking speeds, also of a growing cycle."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincc

from nanorocks_ros.errors import FitError
from nanorocks_ros.inference.sticking.bounce_tables import SPEEDS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.physics.sticking_rates import SlowContacts

# Size of the grid of sticking speeds, which is denser near 0.
_NODES = 600
_HIGHEST = 0.03
_LEAST_SHARE = 0.3
# The reach of a body over that of a bead is its number of beads to this power: in a flat tray a
# compact body of m beads is m^(1/2) beads wide. Simulated bodies that turn, and those that do
# not, merge with powers of 0.4 to 0.6 (`python -m benchmarks turning_bodies`).
_REACH_POWER = 0.5
# Merges are reported late; those further back than this rarely change, [s].
_SETTLED = 4.0
# Probabilities below it are taken for it.
_TINY = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True)
class MergeLikelihood:
    """Terms of a Poisson likelihood on a grid of sticking speeds; those of cycles add up.

    Parameters
    ----------
    speeds : ndarray (n,), [m/s]
        Sticking speeds, rising.
    merges : int
    exposed : bool
        Whether there were bodies that could have merged.
    logs : ndarray (n,)
        Sum of the logarithms of the rates of the merges, and log likelihood of the collisions that
        did not stick.
    expected : ndarray (n,)
        Expected number of merges.
    cycles : int
    """

    speeds: NDArray[np.float64]
    merges: int
    exposed: bool
    logs: NDArray[np.float64]
    expected: NDArray[np.float64]
    cycles: int = 1

    def __add__(self, other: MergeLikelihood) -> MergeLikelihood:
        return MergeLikelihood(
            speeds=self.speeds,
            merges=self.merges + other.merges,
            exposed=self.exposed or other.exposed,
            logs=self.logs + other.logs,
            expected=self.expected + other.expected,
            cycles=self.cycles + other.cycles,
        )


class MergeRates:
    """Merge rates of one tray by kinetic theory, compared with its cycles.

    The integral over a cycle is kept: if the same cycle has grown, only its new part is computed.

    Parameters
    ----------
    contacts : SlowContacts
        Of the tray.
    beads : int
        Number in the tray.
    measure : 'normal' or 'total'
        Relative speed that is compared with the sticking speed.
    highest : float, [m/s]
        Upper end of the grid of sticking speeds.
    least_share : float, 0 to 1
        Smallest ratio of bodies to beads; with fewer, larger bodies the theory of single beads
        does not hold.

    Attributes
    ----------
    speeds : ndarray (n,), [m/s]
        Grid of sticking speeds.
    nothing : MergeLikelihood
        Likelihood of no cycles.
    """

    def __init__(
        self,
        contacts: SlowContacts,
        beads: int,
        measure: str = 'normal',
        *,
        highest: float = _HIGHEST,
        least_share: float = _LEAST_SHARE,
    ) -> None:
        self._contacts, self._beads, self._measure = contacts, beads, measure
        self._fewest = least_share * beads
        self.speeds = highest * (np.arange(1, _NODES + 1) / _NODES) ** 2
        nothing = np.zeros(_NODES)
        self.nothing = MergeLikelihood(
            speeds=self.speeds, merges=0, exposed=False, logs=nothing, expected=nothing, cycles=0
        )
        self._known: StickingCycle | None = None
        self._expected = np.zeros(_NODES)

    def terms(self, cycle: StickingCycle) -> MergeLikelihood:
        """Likelihood of a cycle.

        Raises
        ------
        ConfigurationError
            For an unknown measure.
        FitError
            For speeds or times that cannot be used.
        """
        usable = _first_part(_checked(cycle), self._fewest)
        # A cycle of one time tells nothing, unless that is all in which a merge could be known.
        fewest = 2 if usable.merges.size else 1
        if usable.times.size < fewest or usable.bodies[0] <= 1.0:
            return replace(self.nothing, merges=usable.merges.size, cycles=1)
        speeds = np.interp(usable.merges, usable.times, usable.speeds)
        logs = self._contacts.summed_log_rate_below(self.speeds, speeds, self._measure)
        expected = self._expected_in(usable)
        if not usable.merges.size and usable.undecided > 0.0:
            # As many or fewer may have merged: the probability of that, not of none.
            logs = logs + expected + _log_at_most(usable.undecided, expected)
        if usable.merges.size and usable.bounces.size:
            logs = logs + np.interp(self.speeds, SPEEDS, usable.bounces)
        return MergeLikelihood(
            speeds=self.speeds,
            merges=usable.merges.size,
            exposed=True,
            logs=logs + np.log(speeds).sum(),
            expected=expected,
        )

    def _expected_in(self, cycle: StickingCycle) -> NDArray[np.float64]:
        """Expected merges at each sticking speed, (n,), by the trapezoidal rule."""
        if self._known is None or not _begins_with(cycle, self._known):
            self._known, self._expected = None, np.zeros(_NODES)
        first = self._known.times.size - 1 if self._known is not None else 0
        settled = int(np.searchsorted(cycle.times, cycle.times[-1] - _SETTLED))
        if settled > first:
            self._expected = self._expected + self._between(cycle, first, settled)
            self._known = replace(
                cycle,
                times=cycle.times[: settled + 1],
                speeds=cycle.speeds[: settled + 1],
                bodies=cycle.bodies[: settled + 1],
            )
            first = settled
        return self._expected + self._between(cycle, first, cycle.times.size - 1)

    def _between(self, cycle: StickingCycle, first: int, last: int) -> NDArray[np.float64]:
        """The part of the integral from one node to another."""
        part = slice(first, last + 1)
        bodies, speeds = cycle.bodies[part], cycle.speeds[part]
        halves = 0.5 * np.diff(cycle.times[part])
        width = np.append(halves, 0.0) + np.append(0.0, halves)
        # Bodies collide like beads: in pairs, at the speed of the beads, but they are wider.
        wider = (self._beads / bodies) ** _REACH_POWER
        weights = width * 0.5 * bodies**2 / self._beads * wider * speeds * (bodies > 1.0)
        return self._contacts.summed_rate_below(self.speeds, speeds, weights, self._measure)


def _log_at_most(count: float, expected: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the probability of so many events or fewer, if they are expected."""
    return np.asarray(np.log(np.maximum(gammaincc(count + 1.0, expected), _TINY)))


def _begins_with(cycle: StickingCycle, start: StickingCycle) -> bool:
    n = start.times.size
    return (
        np.array_equal(cycle.times[:n], start.times)
        and np.array_equal(cycle.speeds[:n], start.speeds)
        and np.array_equal(cycle.bodies[:n], start.bodies)
    )


def _first_part(cycle: StickingCycle, fewest: float) -> StickingCycle:
    """The cycle up to the last time with enough bodies."""
    used = cycle.bodies >= max(fewest, 1.0 + 1e-9)
    end = int(np.argmin(used)) if not used.all() else used.size
    if end == 0:
        nothing = np.empty(0)
        return replace(cycle, times=nothing, speeds=nothing, bodies=nothing, merges=nothing)
    last = cycle.times[end - 1] if end < used.size else np.inf
    return replace(
        cycle,
        times=cycle.times[:end],
        speeds=cycle.speeds[:end],
        bodies=cycle.bodies[:end],
        merges=cycle.merges[cycle.merges <= last],
    )


def _checked(cycle: StickingCycle) -> StickingCycle:
    sizes = {cycle.times.size, cycle.speeds.size, cycle.bodies.size}
    if len(sizes) > 1 or not cycle.times.size:
        raise FitError(
            'sticking',
            f'{cycle.times.size} times, {cycle.speeds.size} speeds, {cycle.bodies.size} numbers',
            'give as many of each, one at least',
        )
    if not (np.diff(cycle.times) >= 0.0).all():
        raise FitError('sticking', 'times that do not rise', 'sort them')
    if not (np.isfinite(cycle.speeds).all() and (cycle.speeds > 0.0).all()):
        raise FitError(
            'sticking',
            'a speed that is not positive',
            'leave out unknown speeds and beads at rest',
        )
    return cycle
