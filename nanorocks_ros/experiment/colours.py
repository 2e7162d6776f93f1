"""What the materials that were flown look like, as far as it tells them apart in a picture."""

from __future__ import annotations

COLOURS: dict[str, tuple[float, float, float]] = {
    'acrylic': (30.0, 30.0, 200.0),
    'glass': (200.0, 60.0, 30.0),
    'copper': (51.0, 115.0, 184.0),
    'JSC-1': (60.0, 60.0, 60.0),
}
"""Blue, green and red in even light, [gray levels]: only to begin with, the pictures tell more."""

# Of red and blue together, the difference from which a material is red or blue.
_HUED = 0.2


def hue_of(material: str) -> int:
    """1 for a red material, -1 for a blue one, 0 for a gray or an unknown one."""
    blue, _, red = COLOURS.get(material, (1.0, 1.0, 1.0))
    difference = (red - blue) / (red + blue)
    return int(difference > _HUED) - int(difference < -_HUED)
