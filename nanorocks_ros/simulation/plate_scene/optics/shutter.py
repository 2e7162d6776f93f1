"""Instants at which the shutter is open: their mean is the motion blur of a frame.

Tested by ``test/simulation/plate_scene/test_optics.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Instants of one exposure at most; they are odd in number, so that one is that of the stamp.
MOST = 15
# Path of the fastest bead between two instants, [px]: less than the outline is wide.
_STEP_PX = 0.6
# The same of the plate, whose surface shows less.
_PLATE_STEP_PX = 0.4


def instants_for(path: float) -> int:
    """How many instants show a path in the picture without gaps, an odd number.

    Parameters
    ----------
    path : float, [px]
        Of the fastest bead during the exposure.
    """
    return min(2 * int(0.5 * path / _STEP_PX) + 1, MOST)


def shutter_times(
    time: float, opened: float, instants: int
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Instants before and after the stamp of a frame at which the shutter is open, [s].

    Parameters
    ----------
    time : float, [s]
        Of the stamp, the middle of the exposure.
    opened : float, [s]
        How long it is open.
    instants : int, odd
        With that of the stamp. Each stands for an equal part of the exposure.

    Returns
    -------
    before, after : tuple of floats
        No time is below 0, where a film begins.
    """
    half, step = instants // 2, opened / instants
    before = tuple(max(time - step * k, 0.0) for k in range(half, 0, -1))
    return before, tuple(time + step * k for k in range(1, half + 1))


def grouped_path(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """A path in few steps: runs of instants share their mean place.

    Parameters
    ----------
    path : ndarray (n, 2), [px]
        Place of the plate in the picture at each instant.

    Returns
    -------
    ndarray (n, 2), [px]
        With the same mean.
    """
    length = float(np.hypot(*np.diff(path, axis=0).T).sum())
    groups = min(int(length / _PLATE_STEP_PX) + 1, len(path))
    parts = np.array_split(path, groups)
    return np.concatenate([np.broadcast_to(part.mean(axis=0), part.shape) for part in parts])
