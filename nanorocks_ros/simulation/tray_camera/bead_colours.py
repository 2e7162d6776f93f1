"""How beads of each material look under the lamp of the tray."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """Shading of a sphere of one material; all but the colour are fractions.

    Parameters
    ----------
    blue, green, red : float, [gray levels]
        Colour where the light falls straight on.
    ambient, diffuse : float
        Light from everywhere, and from the lamp (Lambert).
    darkening : float
        Loss towards the outline.
    glow : float
        Light gathered inside a clear bead, on the side away from the lamp.
    sheen : float
        Broad reflection of the lamp in the colour of the bead, as of metal.
    highlight : float, [gray levels]
        Mirror image of the lamp.
    """

    blue: float
    green: float
    red: float
    ambient: float
    diffuse: float
    darkening: float
    glow: float
    sheen: float
    highlight: float


LOOKS = {
    'acrylic': Look(
        blue=34, green=26, red=186, ambient=0.38, diffuse=0.62, darkening=0.55, glow=0.55,
        sheen=0.0, highlight=200,
    ),
    'glass': Look(
        blue=178, green=98, red=30, ambient=0.42, diffuse=0.52, darkening=0.60, glow=0.75,
        sheen=0.0, highlight=215,
    ),
    'copper': Look(
        blue=62, green=104, red=184, ambient=0.22, diffuse=0.55, darkening=0.60, glow=0.0,
        sheen=0.65, highlight=120,
    ),
    'JSC-1': Look(
        blue=62, green=66, red=70, ambient=0.45, diffuse=0.55, darkening=0.35, glow=0.0,
        sheen=0.0, highlight=10,
    ),
}  # fmt: skip

# A material of a user's own tray file that has no look of its own.
PLAIN = Look(
    blue=90, green=90, red=90, ambient=0.4, diffuse=0.6, darkening=0.45, glow=0.0, sheen=0.0,
    highlight=90,
)  # fmt: skip


def looks_of(materials: tuple[str, ...]) -> NDArray[np.float64]:
    """Look of each bead, (n, 9), columns as the fields of `Look`."""
    return np.array([astuple(LOOKS.get(name, PLAIN)) for name in materials], dtype=np.float64)
