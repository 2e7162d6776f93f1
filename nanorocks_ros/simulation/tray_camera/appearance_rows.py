"""Looks of beads as rows of numbers, for the drawing kernels.

Tested by ``test/simulation/tray_camera/test_tray_renderer.py``.
"""

from __future__ import annotations

from dataclasses import astuple
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.materials import Material


def look_rows(materials: Sequence[Material]) -> NDArray[np.float64]:
    """Look of each bead, (n, 9), columns as the fields of `Look`."""
    return np.array([astuple(material.look) for material in materials], dtype=np.float64)
