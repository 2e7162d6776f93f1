"""Which colours a picture has."""

from __future__ import annotations

import numpy as np


def colours_of(picture):
    """The colours of a picture (..., 3) of uint8, as tuples in the order of its channels."""
    first, second, third = np.moveaxis(picture.astype(np.uint32), -1, 0)
    packed = np.unique(first << 16 | second << 8 | third).tolist()
    return {(colour >> 16, colour >> 8 & 255, colour & 255) for colour in packed}
