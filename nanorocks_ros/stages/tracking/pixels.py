"""What each pixel of a tray shows: how dark it is, how red or blue, and so what lies there.

A bead of any species is darker than the gray floor in at least one colour: acrylic in blue,
glass in red, copper in blue, JSC-1 in all three. The darkness in the darkest channel is nearly
flat over the disc of a bead, whatever its shading, so that half of it marks the outline. Which
species it is follows from red minus blue over their sum, which shading does not change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.physics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLOOR, RED, BLUE, GRAY, UNKNOWN = range(5)
"""What a pixel shows; UNKNOWN is a highlight, a glare, or what fits no species of the tray."""


class Picture(NamedTuple):
    """What the pixels of a tray show.

    Parameters
    ----------
    darkness : ndarray of uint8, (rows, columns)
        0 for the floor, 255 for black.
    hue : ndarray of int16, (rows, columns), [gray levels]
        Red minus blue, less that of the floor.
    shown : ndarray of uint8, (rows, columns)
        FLOOR to UNKNOWN.
    covered : ndarray of uint8, (rows, columns)
        Bit k is set where a bead of kind k was found.
    """

    darkness: NDArray[np.uint8]
    hue: NDArray[np.int16]
    shown: NDArray[np.uint8]
    covered: NDArray[np.uint8]


# Darkness is kept in 255 steps from the floor to black.
FULL = 255.0
# Of the floor to black, where a pixel of a coloured bead begins; and where a gray one does,
# which must not be taken for shadows that overlap.
_DARK = 0.27
_GRAY_DARK = 0.45
# (red - blue) / (red + blue): copper and acrylic 0.5 to 0.7, glass -0.7, JSC-1 and floor 0.1;
# half of that under chalk.
_COLOURED = 0.2
# Gray levels above the floor, in every channel, of a highlight.
_BRIGHTER = 25
# Darker than the floor by less is floor, without a closer look, in gray levels.
_QUIET = 16
# A floor as bright as this hides what lies on it.
_SATURATED = 248


@compiled
def look_at_pixels(
    color: NDArray[np.uint8], floor: NDArray[np.uint8], gray_known: bool, picture: Picture
) -> None:
    """Compare a picture with the empty floor, pixel by pixel.

    Parameters
    ----------
    color, floor : ndarray of uint8, (rows, columns, 3), bgr
    gray_known : bool
        Whether the tray has a gray species: dark gray is UNKNOWN otherwise.
    picture : Picture
        Written, but for `covered`.
    """
    darkness, hue, shown = picture.darkness, picture.hue, picture.shown
    for i in range(color.shape[0]):
        for j in range(color.shape[1]):
            # Signed: differences of uint8 would wrap around.
            blue = np.int32(color[i, j, 0])
            green = np.int32(color[i, j, 1])
            red = np.int32(color[i, j, 2])
            floor_b = np.int32(floor[i, j, 0])
            floor_g = np.int32(floor[i, j, 1])
            floor_r = np.int32(floor[i, j, 2])
            down = int(max(floor_b - blue, floor_g - green, floor_r - red))
            up = int(min(blue - floor_b, green - floor_g, red - floor_r))
            level = max(int(floor_b), int(floor_g), int(floor_r), 1)
            warm = int((red - blue) - (floor_r - floor_b))
            hue[i, j] = warm
            if -_QUIET < down < _QUIET and up <= _BRIGHTER and level < _SATURATED:
                # Most pixels are floor: no division for them.
                darkness[i, j] = down if down > 0 else 0
                shown[i, j] = FLOOR
                continue
            darkness[i, j] = int(min(max(FULL * down, 0.0) / level, FULL))
            if min(floor_b, floor_g, floor_r) >= _SATURATED or up > _BRIGHTER:
                shown[i, j] = UNKNOWN
            elif down <= _DARK * level:
                shown[i, j] = FLOOR
            elif warm > _COLOURED * (red + blue):
                shown[i, j] = RED
            elif -warm > _COLOURED * (red + blue):
                shown[i, j] = BLUE
            else:
                shown[i, j] = GRAY if gray_known and down > _GRAY_DARK * level else UNKNOWN


# Gray levels of red minus blue, averaged over some pixels, of a bead under chalk.
_DUSTY_HUE = 16
# So many steps of darkness for a level of red minus blue: a quarter of a clean bead's is full.
_DUSTY_STEPS = 5


# Red and blue together of a well lit bead, and how much a dark one is lifted at most.
_LIT = 250.0
_LIFTED = 3.0
_BLACK = 20.0


@compiled
def lift_dark_hues(color: NDArray[np.uint8], hue: NDArray[np.int16]) -> None:
    """Give the dark side of a bead the hue of its lit side.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    hue : ndarray of int16, (rows, columns), [gray levels]
        Changed.
    """
    for i in range(hue.shape[0]):
        for j in range(hue.shape[1]):
            light = float(color[i, j, 0]) + float(color[i, j, 2]) + _BLACK
            hue[i, j] = int(hue[i, j] * min(max(_LIT / light, 1.0), _LIFTED))


@compiled
def look_at_dusty_pixels(floor: NDArray[np.uint8], picture: Picture) -> None:
    """The same for beads and floor under chalk, and glare: only the hue tells them apart.

    Parameters
    ----------
    floor : ndarray of uint8, (rows, columns, 3), bgr
    picture : Picture
        With its hue, smoothed: patches of chalk on a bead have none. `shown` is written, and
        `darkness`, to how much hue there is.
    """
    darkness, hue, shown = picture.darkness, picture.hue, picture.shown
    for i in range(hue.shape[0]):
        for j in range(hue.shape[1]):
            warm = np.int32(hue[i, j])
            darkness[i, j] = min(_DUSTY_STEPS * abs(warm), np.int32(255))
            if warm > _DUSTY_HUE:
                shown[i, j] = RED
            elif warm < -_DUSTY_HUE:
                shown[i, j] = BLUE
            elif min(floor[i, j, 0], floor[i, j, 1], floor[i, j, 2]) >= _SATURATED:
                shown[i, j] = UNKNOWN
            else:
                shown[i, j] = FLOOR
