"""Exponentials and logarithms of ``+ - * /`` alone: the same bits on every machine.

The usual ones call a mathematical library, whose last bits differ from one to the next.
"""

from __future__ import annotations

import math

from nanorocks_ros.numerics.compiled import compiled, inlined

_LOG_2 = 0.6931471805599453
_SQRT_HALF = math.sqrt(0.5)
# Terms of the series of the logarithm: the next one is below 3e-18 of the sum.
_TERMS = 11
# Below this the series of an exponential is summed: the next term is below 1e-17 of the sum.
_SMALL = 0.25
_FACTORS = 12
# exp(-x) is below the smallest number from here on.
_NOTHING_LEFT = 746.0


@compiled
def logarithm(x: float) -> float:
    """Natural logarithm of a number in (0, 1), the same bits on every machine.

    Halves are taken out until the rest m is near 1; then log m = 2 artanh z with
    z = (m - 1)/(m + 1), whose series in z^2 < 0.03 is summed.
    """
    halves = 0
    while x < _SQRT_HALF:
        x *= 2.0
        halves += 1
    z = (x - 1.0) / (x + 1.0)
    return 2.0 * z * _artanh_over(z) - halves * _LOG_2


@inlined
def _artanh_over(z: float) -> float:
    """The series of artanh z / z."""
    square = z * z
    total = 0.0
    for k in range(_TERMS - 1, -1, -1):
        total = total * square + 1.0 / (2 * k + 1)
    return total


@compiled
def decayed(x: float) -> tuple[float, float]:
    """How much of a decaying quantity has gone, and what is left: 1 - exp(-x), exp(-x).

    Both with nearly all digits, however small they are.

    Parameters
    ----------
    x : float, >= 0
        Time in decay times; may be infinite.
    """
    if x >= _NOTHING_LEFT:
        return 1.0, 0.0
    halves = 0
    while x > _SMALL:
        x *= 0.5
        halves += 1
    total = 1.0
    for k in range(_FACTORS, 1, -1):
        total = 1.0 - x / k * total
    gone = x * total
    left = 1.0 - gone
    for _ in range(halves):
        gone *= 1.0 + left
        left *= left
    return gone, left


@compiled
def decay_time(gone: float) -> float:
    """Time in decay times until so much has gone, -log(1 - gone); infinite from 1 on.

    Parameters
    ----------
    gone : float, >= 0
    """
    if gone >= 1.0:
        return math.inf
    if gone > _SMALL:
        return -logarithm(1.0 - gone)
    z = gone / (2.0 - gone)
    return 2.0 * z * _artanh_over(z)
