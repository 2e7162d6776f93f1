"""Cubic splines evaluated at a few points, compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

_ORDER = 4


@compiled
def spline_slopes(nodes: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives at the nodes of the cubic spline with not-a-knot ends.

    Parameters
    ----------
    nodes : ndarray (n,)
        Rising, 4 or more.
    values : ndarray (n,)
    """
    n = nodes.size
    width = np.diff(nodes)
    slope = np.diff(values) / width
    # Tridiagonal equations, solved from the first row down and up again.
    diagonal, above, derivatives = np.empty(n), np.empty(n), np.empty(n)
    span = width[0] + width[1]
    diagonal[0], above[0] = width[1], span
    derivatives[0] = (
        (width[0] + 2.0 * span) * width[1] * slope[0] + width[0] ** 2 * slope[1]
    ) / span
    for i in range(1, n):
        if i < n - 1:
            below, own, above[i] = width[i], 2.0 * (width[i - 1] + width[i]), width[i - 1]
            derivatives[i] = 3.0 * (width[i] * slope[i - 1] + width[i - 1] * slope[i])
        else:
            span = width[n - 2] + width[n - 3]
            below, own = span, width[n - 3]
            derivatives[i] = (
                width[n - 2] ** 2 * slope[n - 3]
                + (2.0 * span + width[n - 2]) * width[n - 3] * slope[n - 2]
            ) / span
        share = below / diagonal[i - 1]
        diagonal[i] = own - share * above[i - 1]
        derivatives[i] -= share * derivatives[i - 1]
    derivatives[n - 1] /= diagonal[n - 1]
    for i in range(n - 2, -1, -1):
        derivatives[i] = (derivatives[i] - above[i] * derivatives[i + 1]) / diagonal[i]
    return derivatives


@compiled
def spline_at(
    nodes: NDArray[np.float64],
    values: NDArray[np.float64],
    slopes: NDArray[np.float64],
    at: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The spline at rising points, (m,), extrapolated beyond the ends."""
    interpolated = np.empty(at.size)
    cell = 0
    for k in range(at.size):
        while cell < nodes.size - 2 and at[k] >= nodes[cell + 1]:
            cell += 1
        width = nodes[cell + 1] - nodes[cell]
        slope = (values[cell + 1] - values[cell]) / width
        bend = (slopes[cell] + slopes[cell + 1] - 2.0 * slope) / width
        offset = at[k] - nodes[cell]
        second = (slope - slopes[cell]) / width - bend
        interpolated[k] = values[cell] + offset * (
            slopes[cell] + offset * (second + offset * bend / width)
        )
    return interpolated


@compiled
def spline_basis(knots: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cubic B-splines of some knots at points within them, (m, n_knots - 4)."""
    n = knots.size - _ORDER
    basis = np.zeros((at.size, n))
    part = np.empty(_ORDER)
    for k in range(at.size):
        cell = min(max(np.searchsorted(knots, at[k], side='right') - 1, _ORDER - 1), n - 1)
        # The recursion of de Boor and Cox.
        part[0] = 1.0
        for degree in range(1, _ORDER):
            saved = 0.0
            for r in range(degree):
                right, left = knots[cell + r + 1], knots[cell + 1 - degree + r]
                term = part[r] / (right - left)
                part[r] = saved + (right - at[k]) * term
                saved = (at[k] - left) * term
            part[degree] = saved
        for r in range(_ORDER):
            basis[k, cell - _ORDER + 1 + r] = part[r]
    return basis
