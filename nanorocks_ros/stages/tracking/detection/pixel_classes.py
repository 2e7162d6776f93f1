"""What each pixel of a tray shows: how dark it is, how red or blue, and so what lies there.

A bead of any species is darker than the gray floor in at least one colour: acrylic in blue,
glass in red, copper in blue, JSC-1 in all three. The darkness in the darkest channel is nearly
flat over the disc of a bead, whatever its shading, so that half of it marks the outline. Which
species it is follows from red minus blue over their sum, which shading does not change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

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


# Of the floor to black in hundredths, where a pixel of a coloured bead begins; and where a gray
# one does, which must not be taken for shadows that overlap.
_DARK = 27
_GRAY_DARK = 45
# (red + blue) / (red - blue): copper and acrylic 1.4 to 2, glass -1.4, JSC-1 and floor 10;
# twice that under chalk.
_COLOURED = 5
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
    # Flat arrays, unsigned places, short whole numbers and choices instead of branches: so the
    # compiler does many pixels at once. No product needs more than 16 bits but that of `steps`.
    pixels, empty = color.reshape(-1), floor.reshape(-1)
    darkness, hue, shown = (
        picture.darkness.reshape(-1),
        picture.hue.reshape(-1),
        picture.shown.reshape(-1),
    )
    dark_gray = np.uint8(GRAY) if gray_known else np.uint8(UNKNOWN)
    one, two, three, zero = np.uint64(1), np.uint64(2), np.uint64(3), np.int16(0)
    for pixel in range(shown.size):
        k = np.uint64(pixel)
        # Signed: differences of uint8 would wrap around.
        blue, floor_b = np.int16(pixels[three * k]), np.int16(empty[three * k])
        green, floor_g = np.int16(pixels[three * k + one]), np.int16(empty[three * k + one])
        red, floor_r = np.int16(pixels[three * k + two]), np.int16(empty[three * k + two])
        b, g, r = np.int16(floor_b - blue), np.int16(floor_g - green), np.int16(floor_r - red)
        down = max(b, max(g, r))
        up = min(np.int16(-b), min(np.int16(-g), np.int16(-r)))
        level = max(floor_b, max(floor_g, max(floor_r, np.int16(1))))
        warm = np.int16(np.int16(red - blue) - np.int16(floor_r - floor_b))
        hue[k] = warm
        quiet = (down < _QUIET) & (down > -_QUIET) & (up <= _BRIGHTER) & (level < _SATURATED)
        steps = np.int32(np.float32(255 * np.int32(max(down, zero))) / np.float32(level))
        calm, loud = np.uint8(max(down, zero)), np.uint8(min(steps, np.int32(255)))
        darkness[k] = calm if quiet else loud
        depth, light, colour = (
            np.int16(100 * down),
            np.int16(red + blue),
            np.int16(_COLOURED * warm),
        )
        bead = dark_gray if depth > np.int16(_GRAY_DARK * level) else np.uint8(UNKNOWN)
        bead = np.uint8(BLUE) if np.int16(-colour) > light else bead
        bead = np.uint8(RED) if colour > light else bead
        bead = np.uint8(FLOOR) if depth <= np.int16(_DARK * level) else bead
        hidden = (min(floor_b, min(floor_g, floor_r)) >= _SATURATED) | (up > _BRIGHTER)
        bead = np.uint8(UNKNOWN) if hidden else bead
        shown[k] = np.uint8(FLOOR) if quiet else bead


# Gray levels of red minus blue, averaged over some pixels, of a bead under chalk.
_DUSTY_HUE = 16
# So many steps of darkness for a level of red minus blue: a quarter of a clean bead's is full.
_DUSTY_STEPS = 5


# Red and blue together of a well lit bead, and how much a dark one is lifted at most.
_LIT = np.float32(250.0)
_LIFTED = np.float32(3.0)
_BLACK = np.float32(20.0)


@compiled
def lift_dark_hues(color: NDArray[np.uint8], hue: NDArray[np.int16]) -> None:
    """Give the dark side of a bead the hue of its lit side.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
    hue : ndarray of int16, (rows, columns), [gray levels]
        Changed.
    """
    pixels, lifted = color.reshape(-1), hue.reshape(-1)
    two, three = np.uint64(2), np.uint64(3)
    for pixel in range(lifted.size):
        k = np.uint64(pixel)
        light = np.float32(pixels[three * k]) + np.float32(pixels[three * k + two]) + _BLACK
        factor = min(max(_LIT / light, np.float32(1.0)), _LIFTED)
        lifted[k] = np.int16(np.float32(lifted[k]) * factor)


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
    empty, hue = floor.reshape(-1), picture.hue.reshape(-1)
    darkness, shown = picture.darkness.reshape(-1), picture.shown.reshape(-1)
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for pixel in range(shown.size):
        k = np.uint64(pixel)
        warm = np.int32(hue[k])
        darkness[k] = np.uint8(min(_DUSTY_STEPS * abs(warm), np.int32(255)))
        least = min(empty[three * k], min(empty[three * k + one], empty[three * k + two]))
        bead = np.uint8(UNKNOWN) if least >= _SATURATED else np.uint8(FLOOR)
        bead = np.uint8(BLUE) if warm < -_DUSTY_HUE else bead
        shown[k] = np.uint8(RED) if warm > _DUSTY_HUE else bead
