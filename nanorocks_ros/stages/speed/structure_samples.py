"""What the structure function is measured in: pairs of images at several lags.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# A later and an earlier image, each with its stamp.
ImagePair = tuple[tuple[int, 'NDArray[np.uint8]'], tuple[int, 'NDArray[np.uint8]']]


@dataclass(frozen=True, slots=True)
class Sample:
    """Structure function at every lag, at one instant.

    Parameters
    ----------
    cycle : int
    cycle_start_ns : int or None, [ns]
    noise_power : float, [gray levels^2]
    middles_ns, windows_ns : ndarray of int64, (n_lags,), [ns]
        Middle and length of the time between the two images.
    shifts_px : ndarray (n_lags,), [px]
        How far the tray moved past the beads in the images between them.
    tray_px : ndarray (n_lags,), [px]
        How far the tray moved past the camera.
    powers : ndarray (n_lags,), [gray levels^2]
        Sums over the image, free of noise.
    """

    cycle: int
    cycle_start_ns: int | None
    noise_power: float
    middles_ns: NDArray[np.int64]
    windows_ns: NDArray[np.int64]
    shifts_px: NDArray[np.float64]
    tray_px: NDArray[np.float64]
    powers: NDArray[np.float64]


def lag_ladder(longest: int) -> tuple[int, ...]:
    """Lags that grow by about a third each, from one frame to the longest."""
    lags = [1]
    while lags[-1] < longest:
        lags.append(min(longest, max(lags[-1] + 1, (4 * lags[-1] + 1) // 3)))
    return tuple(lags)
