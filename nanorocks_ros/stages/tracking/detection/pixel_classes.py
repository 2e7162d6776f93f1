"""Pixel classification: darkness and hue of each pixel, and the species it shows.

A bead of any species is darker than the gray floor in at least one channel: acrylic in blue,
glass in red, copper in blue, JSC-1 in all three. The darkness in the darkest channel is nearly
constant over the disc of a bead, whatever its shading, so that half of it marks the outline. Red
minus blue over their sum gives the species; shading does not change it.

Tested by ``test/stages/tracking/detection/test_bead_detector.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLOOR, RED, BLUE, GRAY, UNKNOWN = range(5)
"""Pixel classes; UNKNOWN is a highlight, a glare, or a colour of no species of the tray."""


class PixelMaps(NamedTuple):
    """Maps of the pixels of a tray image.

    Parameters
    ----------
    darkness : ndarray of uint8, (rows, columns)
        0 for the background, 255 for black.
    hue : ndarray of int16, (rows, columns), [gray levels]
        Red minus blue, minus that of the background.
    pixel_class : ndarray of uint8, (rows, columns)
        FLOOR to UNKNOWN.
    covered : ndarray of uint8, (rows, columns)
        Bit k is set where a bead of class k was found.
    shifts : ndarray (2, rays), [px]
        For edges searched within 2 and 3 px: distance of the edge on each ray from the outline.
    biases : ndarray (2, curvatures), [px]
        The same by blur, on a bead of a given curvature; see `edge_biases`.
    edge_levels : tuple of 2 floats
        At an edge of a bead: smallest step of the darkness, and largest darkness outside.
    """

    darkness: NDArray[np.uint8]
    hue: NDArray[np.int16]
    pixel_class: NDArray[np.uint8]
    covered: NDArray[np.uint8]
    shifts: NDArray[np.float64]
    biases: NDArray[np.float64]
    edge_levels: tuple[float, float]


# Smallest darkness of a pixel of a coloured bead, in percent from background to black.
_DARK_PERCENT = 27
# (red + blue) / (red - blue): copper and acrylic 1.4 to 2, glass -1.4, JSC-1 and floor 10;
# twice that under chalk.
_COLOURED = 5
# Gray levels above the background, in every channel, of a highlight.
_HIGHLIGHT_LEVELS = 25
# Deviation from the background, in gray levels, below which a pixel is background.
_NOISE_LEVELS = 16
# Background level above which beads are not visible.
_SATURATED = 248


@compiled
def classify_pixels(
    color: NDArray[np.uint8], background: NDArray[np.uint8], gray_percent: int, maps: PixelMaps
) -> None:
    """Classify the pixels of an image by comparison with the background.

    Parameters
    ----------
    color, background : ndarray of uint8, (rows, columns, 3), bgr
    gray_percent : int, [%]
        Smallest darkness of a pixel of a gray bead, from background to black; 100 without a gray
        species: dark gray is UNKNOWN then.
    maps : PixelMaps
        Written, except `covered`.
    """
    # Flat arrays, unsigned indices, 16-bit integers and no branches let the compiler vectorise the
    # loop. Only the product in `scaled` needs more than 16 bits.
    pixels, empty = color.reshape(-1), background.reshape(-1)
    darkness, hue = maps.darkness.reshape(-1), maps.hue.reshape(-1)
    pixel_class = maps.pixel_class.reshape(-1)
    least_gray = np.int16(gray_percent)
    one, two, three, zero = np.uint64(1), np.uint64(2), np.uint64(3), np.int16(0)
    for pixel in range(pixel_class.size):
        k = np.uint64(pixel)
        # Signed: differences of uint8 would wrap around.
        blue, floor_b = np.int16(pixels[three * k]), np.int16(empty[three * k])
        green, floor_g = np.int16(pixels[three * k + one]), np.int16(empty[three * k + one])
        red, floor_r = np.int16(pixels[three * k + two]), np.int16(empty[three * k + two])
        b, g, r = np.int16(floor_b - blue), np.int16(floor_g - green), np.int16(floor_r - red)
        darkening = max(b, max(g, r))
        brightening = min(np.int16(-b), min(np.int16(-g), np.int16(-r)))
        level = max(floor_b, max(floor_g, max(floor_r, np.int16(1))))
        redness = np.int16(np.int16(red - blue) - np.int16(floor_r - floor_b))
        hue[k] = redness
        is_background = (
            (darkening < _NOISE_LEVELS)
            & (darkening > -_NOISE_LEVELS)
            & (brightening <= _HIGHLIGHT_LEVELS)
            & (level < _SATURATED)
        )
        scaled = np.int32(np.float32(255 * np.int32(max(darkening, zero))) / np.float32(level))
        small_darkness = np.uint8(max(darkening, zero))
        scaled_darkness = np.uint8(min(scaled, np.int32(255)))
        darkness[k] = small_darkness if is_background else scaled_darkness
        depth, light = np.int16(100 * darkening), np.int16(red + blue)
        colour = np.int16(_COLOURED * redness)
        kind = np.uint8(GRAY) if depth > np.int16(least_gray * level) else np.uint8(UNKNOWN)
        kind = np.uint8(BLUE) if np.int16(-colour) > light else kind
        kind = np.uint8(RED) if colour > light else kind
        kind = np.uint8(FLOOR) if depth <= np.int16(_DARK_PERCENT * level) else kind
        is_glare = (min(floor_b, min(floor_g, floor_r)) >= _SATURATED) | (
            brightening > _HIGHLIGHT_LEVELS
        )
        kind = np.uint8(UNKNOWN) if is_glare else kind
        pixel_class[k] = np.uint8(FLOOR) if is_background else kind


# Red minus blue of a chalky bead, averaged over some pixels, in gray levels.
_CHALKY_HUE = 16
# Darkness per gray level of red minus blue: a quarter of the hue of a clean bead is full scale.
_CHALKY_DARKNESS = 5


# Red plus blue of a well lit bead, largest correction factor, and offset for black.
_LIT_LEVEL = np.float32(250.0)
_MAX_FACTOR = np.float32(3.0)
_DARK_OFFSET = np.float32(20.0)


@compiled
def brighten_dark_hues(color: NDArray[np.uint8], hue: NDArray[np.int16]) -> None:
    """Scale the hue of the dark side of beads to that of the lit side.

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
        light = np.float32(pixels[three * k]) + np.float32(pixels[three * k + two]) + _DARK_OFFSET
        factor = min(max(_LIT_LEVEL / light, np.float32(1.0)), _MAX_FACTOR)
        lifted[k] = np.int16(np.float32(lifted[k]) * factor)


@compiled
def classify_chalky_pixels(background: NDArray[np.uint8], maps: PixelMaps) -> None:
    """Classify the pixels of a tray under chalk, by hue only.

    Parameters
    ----------
    background : ndarray of uint8, (rows, columns, 3), bgr
    maps : PixelMaps
        `hue` must be smoothed, as patches of chalk on a bead have none. `pixel_class` and
        `darkness` are written; `darkness` is the size of the hue.
    """
    empty, hue = background.reshape(-1), maps.hue.reshape(-1)
    darkness, pixel_class = maps.darkness.reshape(-1), maps.pixel_class.reshape(-1)
    one, two, three = np.uint64(1), np.uint64(2), np.uint64(3)
    for pixel in range(pixel_class.size):
        k = np.uint64(pixel)
        redness = np.int32(hue[k])
        darkness[k] = np.uint8(min(_CHALKY_DARKNESS * abs(redness), np.int32(255)))
        darkest = min(empty[three * k], min(empty[three * k + one], empty[three * k + two]))
        kind = np.uint8(UNKNOWN) if darkest >= _SATURATED else np.uint8(FLOOR)
        kind = np.uint8(BLUE) if redness < -_CHALKY_HUE else kind
        pixel_class[k] = np.uint8(RED) if redness > _CHALKY_HUE else kind
