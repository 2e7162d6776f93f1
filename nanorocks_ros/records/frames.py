"""Camera frames, tray images and motion masks.

Tested by ``test/wire/test_array_layouts.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records.quality_flags import NOTHING_WRONG, UNKNOWN, Quality, freeze_arrays

if TYPE_CHECKING:
    from numpy.typing import NDArray

NS = 1_000_000_000
"""Nanoseconds in a second: stamps are whole nanoseconds, times and intervals are in seconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One image of the whole scene, as the camera gave it.

    Parameters
    ----------
    stamp_ns : int
        Instant of exposure, [ns].
    encoding : str
        ``bgr8``, ``rgb8`` or ``mono8``.
    image : ndarray of uint8, (height, width, 3) or (height, width)
    """

    stamp_ns: int
    encoding: str
    image: NDArray[np.uint8]

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayImage:
    """The crop of one tray, in colour where the camera gives it, and its gray mix.

    Parameters
    ----------
    stamp_ns : int
    tray : int
    gray : ndarray of uint8, (rows, columns)
        Rectified, and moved back by the displacement of the tray.
    color : ndarray of uint8, (rows, columns, 3), bgr, or None for a gray camera
    cycle : int or None
        Shaking events so far; None when nobody has counted yet.
    cycle_start_ns : int or None
        The shaking event that opened the cycle; None before the first.
    noise_power : float, [gray levels^2]
        Mean squared difference per pixel of two images of a scene at rest; NaN when unknown.
    displacement : tuple of 2 floats, [m]
        Of the tray in the picture, along columns and rows, from where it was at first; NaN when
        there is nothing to measure it by.
    displacement_error : float, [m]
        One standard error, of each component.
    velocity : tuple of 2 floats, [m/s]
        Of the tray, since the image before.
    velocity_error : float, [m/s]
    quality : Quality
    glare : float, 0 to 1
        Share of the picture that is hidden by reflections; NaN when unknown.
    """

    stamp_ns: int
    tray: int
    gray: NDArray[np.uint8]
    color: NDArray[np.uint8] | None = None
    cycle: int | None = None
    cycle_start_ns: int | None = None
    noise_power: float = UNKNOWN
    displacement: tuple[float, float] = (UNKNOWN, UNKNOWN)
    displacement_error: float = UNKNOWN
    velocity: tuple[float, float] = (UNKNOWN, UNKNOWN)
    velocity_error: float = UNKNOWN
    quality: Quality = NOTHING_WRONG
    glare: float = UNKNOWN

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def state(self) -> TrayState:
        """The image without its pixels."""
        return TrayState(
            stamp_ns=self.stamp_ns,
            tray=self.tray,
            cycle=self.cycle or 0,
            cycle_start_ns=self.cycle_start_ns,
            noise_power=self.noise_power,
            displacement_x=self.displacement[0],
            displacement_y=self.displacement[1],
            displacement_error=self.displacement_error,
            velocity_x=self.velocity[0],
            velocity_y=self.velocity[1],
            velocity_error=self.velocity_error,
            quality=self.quality,
            glare=self.glare,
            color=int(self.color is not None),
        )

    @classmethod
    def of_state(
        cls,
        state: TrayState,
        stamp_ns: int,
        gray: NDArray[np.uint8],
        color: NDArray[np.uint8] | None,
    ) -> TrayImage:
        """The image from its state and its pixels; the stamp is that of the pixels."""
        return cls(
            stamp_ns=stamp_ns,
            tray=state.tray,
            gray=gray,
            color=color,
            cycle=state.cycle,
            cycle_start_ns=state.cycle_start_ns,
            noise_power=state.noise_power,
            displacement=(state.displacement_x, state.displacement_y),
            displacement_error=state.displacement_error,
            velocity=(state.velocity_x, state.velocity_y),
            velocity_error=state.velocity_error,
            quality=state.quality,
            glare=state.glare,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TrayState:
    """A tray image without its pixels; see :class:`TrayImage`.

    Parameters
    ----------
    color : int
        1 when there is a colour image too, 0 for a gray camera.
    """

    stamp_ns: int
    tray: int
    cycle: int
    cycle_start_ns: int | None
    noise_power: float
    displacement_x: float
    displacement_y: float
    displacement_error: float
    velocity_x: float
    velocity_y: float
    velocity_error: float
    quality: Quality
    glare: float
    color: int


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionMask:
    """Where something moved: 255 in moving pixels, 0 elsewhere ([B19] fig. 4d)."""

    stamp_ns: int
    tray: int
    mask: NDArray[np.uint8]

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """A message for the user that is not an error."""

    stamp_ns: int
    text: str
