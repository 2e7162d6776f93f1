"""Smoothing of curves by polynomials that are fitted to a moving window.

The filter of `scipy.signal`, bit by bit; to import that package takes a quarter of a start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import linalg

if TYPE_CHECKING:
    from numpy.typing import NDArray


def savitzky_golay(curves: NDArray[np.float64], window: int, order: int) -> NDArray[np.float64]:
    """Smooth curves along their last axis.

    Parameters
    ----------
    curves : ndarray (..., n), n >= window
    window : int
        Width of the window, odd.
    order : int
        Of the polynomials.

    Returns
    -------
    ndarray (..., n)
        The values of the fits in the middle of their windows; at the ends, of the first and the
        last fit.

    References
    ----------
    Savitzky and Golay 1964, Anal. Chem. 36, 1627.
    """
    half = window // 2
    powers = np.arange(half, -half - 1, -1.0) ** np.arange(order + 1.0)[:, np.newaxis]
    weights = linalg.lstsq(powers, np.eye(order + 1)[0])[0]
    n = curves.shape[-1]
    smooth = np.empty(curves.shape)
    middle = curves[..., half : n - half] * weights[half]
    for k in range(-half, 0):
        below = curves[..., half + k : n - half + k]
        middle += (below + curves[..., half - k : n - half - k]) * weights[half - k]
    smooth[..., half : n - half] = middle
    smooth[..., :half] = _fitted(curves[..., :window], order, np.arange(half))
    smooth[..., n - half :] = _fitted(
        curves[..., n - window :], order, np.arange(half + 1, window)
    )
    return smooth


def _fitted(
    values: NDArray[np.float64], order: int, places: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The polynomials that fit all values best, at some places."""
    window = values.shape[-1]
    rows = np.moveaxis(values, -1, 0)
    fits = np.polyfit(np.arange(window, dtype=np.float64), rows.reshape(window, -1), order)
    fitted: Any = np.polyval(fits, places[:, np.newaxis].astype(np.float64))
    ends: NDArray[np.float64] = fitted.reshape(places.size, *rows.shape[1:])
    return np.moveaxis(ends, 0, -1)
