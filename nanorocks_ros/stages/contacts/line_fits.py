"""Straight flights in a track: where one ends and the next begins, and the lines through them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.linking.free_flight import fit_line as _fit

_SUMS = 8
LINE = 10
"""Numbers of a line in an array, in the order of the fields of `Line`."""


class Line(NamedTuple):
    """A straight line through the places of a flight.

    Parameters
    ----------
    time : float, [s]
        Centre of the line, where the errors of place and velocity are independent.
    place, velocity : ndarray (2,), [m], [m/s]
    place_variance, velocity_variance : float, [m^2], [m^2/s^2]
        Of a component.
    chi_square : float
        Of the residuals, with ``2 used - 4`` degrees of freedom.
    used : int
        Places it goes through.
    duration : float, [s]
        From the first to the last of them.
    """

    time: float
    place: NDArray[np.float64]
    velocity: NDArray[np.float64]
    place_variance: float
    velocity_variance: float
    chi_square: float
    used: int
    duration: float

    @classmethod
    def of(cls, row: NDArray[np.float64]) -> Line:
        """The line whose numbers are in an array, (LINE,)."""
        *_, place, velocity, chi_square, used, duration = row.tolist()
        return cls(
            float(row[0]), row[1:3], row[3:5], place, velocity, chi_square, int(used), duration
        )

    @property
    def row(self) -> NDArray[np.float64]:
        """Its numbers in an array, (LINE,)."""
        return np.hstack(self)

    def at(self, time: float) -> NDArray[np.float64]:
        """Place at a time, (2,), [m]."""
        return self.place + self.velocity * (time - self.time)


@compiled
def _chi_square(sums: NDArray[np.float64], first: int, end: int) -> float:
    """Of a line in both coordinates; sums of w, wt, wtt, wx, wxt, wy, wyt, w(xx+yy)."""
    w = sums[end, 0] - sums[first, 0]
    t = sums[end, 1] - sums[first, 1]
    x = sums[end, 3] - sums[first, 3]
    y = sums[end, 5] - sums[first, 5]
    spread = sums[end, 2] - sums[first, 2] - t * t / w
    across = sums[end, 4] - sums[first, 4] - t * x / w
    down = sums[end, 6] - sums[first, 6] - t * y / w
    slope = (across * across + down * down) / spread if spread > 0.0 else 0.0
    chi_square: float = sums[end, 7] - sums[first, 7] - (x * x + y * y) / w - slope
    return chi_square


@compiled
def best_break(
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    fewest: int,
) -> tuple[int, float]:
    """Where two straight lines explain some places best.

    Parameters
    ----------
    times : ndarray (n,), [s]
    places : ndarray (n, 2), [m]
    errors : ndarray (n,), [m]
        Of a coordinate.
    fewest : int, >= 2
        Places on each side.

    Returns
    -------
    first : int
        First place of the second line; 0 when there are too few places.
    gain : float
        By how much chi square falls below that of a single line.
    """
    n = times.size
    if n < 2 * fewest:
        return 0, 0.0
    sums = np.zeros((n + 1, _SUMS))
    for k in range(n):
        # From the first place, so that squares stay small.
        t = times[k] - times[0]
        x, y = places[k, 0] - places[0, 0], places[k, 1] - places[0, 1]
        w = 1.0 / (errors[k] * errors[k])
        for c, term in enumerate((1.0, t, t * t, x, x * t, y, y * t, x * x + y * y)):
            sums[k + 1, c] = sums[k, c] + w * term
    least, first = np.inf, 0
    for k in range(fewest, n - fewest + 1):
        both = _chi_square(sums, 0, k) + _chi_square(sums, k, n)
        if both < least:
            least, first = both, k
    return first, _chi_square(sums, 0, n) - least


@compiled
def line_through(
    times: NDArray[np.float64],
    places: NDArray[np.float64],
    errors: NDArray[np.float64],
    row: NDArray[np.float64],
) -> None:
    """The line through places (n, 2), n >= 2, weighted by their errors, into an array (LINE,)."""
    _fit(times, places, errors, row)
    row[9] = times[-1] - times[0]


@compiled
def set_errors(row: NDArray[np.float64], variance: float, drift: float, length: float) -> None:
    """Give a line other errors of its places.

    Parameters
    ----------
    row : ndarray (LINE,)
        Changed.
    variance : float
        Of what scatters from place to place, over what was said.
    drift : float, [m]
        Standard error that is another one further on.
    length : float, [m]
        How far on; along a shorter way before and after a contact it tilts both lines alike,
        which their ratio does not feel.
    """
    duration = row[9]
    square = (row[3] * row[3] + row[4] * row[4]) * duration * duration
    apart = square / (square + length * length)
    tilt = drift / duration
    row[5] *= variance
    # Slopes feel the ends most: one whole wave along a flight tilts it by nearly this.
    row[6] = variance * row[6] + apart * 4.0 * tilt * tilt
    row[7] /= variance


def fit_line(
    times: NDArray[np.float64], places: NDArray[np.float64], errors: NDArray[np.float64]
) -> Line:
    """The line through places (n, 2), n >= 2, weighted by their errors."""
    row = np.empty(LINE)
    line_through(times, places, errors, row)
    return Line.of(row)


class Meeting(NamedTuple):
    """When two lines of one bead meet, or those of several beads all at once.

    Parameters
    ----------
    time, error : float, [s]
    chi_square : float
        Of the places that do not agree then; ``2 beads - 1`` degrees of freedom.
    """

    time: float
    error: float
    chi_square: float


@compiled
def when_met(lines: NDArray[np.float64]) -> tuple[float, float, float]:
    """Time, error and chi square of a `Meeting` of lines, (beads, 2, LINE)."""
    beads = lines.shape[0]
    time = 0.0
    for k in range(beads):
        time += lines[k, 0, 0] + lines[k, 1, 0]
    time *= 0.5 / beads
    error, chi_square = np.inf, 0.0
    # The errors of the lines depend on the instant; two rounds are enough.
    for _ in range(2):
        top, bottom, rest = 0.0, 0.0, 0.0
        for k in range(beads):
            before, after = lines[k, 0], lines[k, 1]
            since, to = time - before[0], time - after[0]
            variance = before[5] + before[6] * since * since + after[5] + after[6] * to * to
            x = after[1] + after[3] * to - before[1] - before[3] * since
            y = after[2] + after[4] * to - before[2] - before[4] * since
            u, v = after[3] - before[3], after[4] - before[4]
            top -= (x * u + y * v) / variance
            bottom += (u * u + v * v) / variance
            rest += (x * x + y * y) / variance
        step = top / bottom
        time += step
        error, chi_square = 1.0 / math.sqrt(bottom), max(rest - top * step, 0.0)
    return time, error, chi_square
