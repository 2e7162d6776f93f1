"""Images of beads whose path is known, kept until two of them are unrelated.

While the tracks measure the speed, the structure function can learn how the beads look. Later may
be too late: in a crowd slow beads keep their places while others move by many diameters.

Tested by ``test/stages/speed/test_unrelated_pairs.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Images that are kept of each species.
_KEPT = 3


class UnrelatedPairs:
    """Pairs of images of one species between which the beads have left their places.

    Parameters
    ----------
    unrelated_px : float, [px]
        Mean path of the beads after which two images are unrelated.
    """

    def __init__(self, unrelated_px: float) -> None:
        self._spacing = unrelated_px / (_KEPT - 1)
        self._path = 0.0
        self._kept: deque[tuple[float, NDArray[np.uint8]]] = deque(maxlen=_KEPT)

    def move(self, path_px: float) -> bool:
        """Whether the next image is needed, once the beads moved on by this mean path."""
        self._path += max(path_px, 0.0)
        return not self._kept or self._path - self._kept[-1][0] >= self._spacing

    def push(self, image: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], float] | None:
        """Keep an image.

        Returns
        -------
        tuple of ndarray of uint8 and float or None
            An earlier image that is not related to it, and the mean path between the two, [px].
        """
        self._kept.append((self._path, image))
        if len(self._kept) < _KEPT:
            return None
        path, earlier = self._kept[0]
        return earlier, self._path - path
