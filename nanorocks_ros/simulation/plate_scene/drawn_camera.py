"""Cameras drawn at random: every effect of the scene from a stated range.

The flight camera is one case; what is drawn here is what films from elsewhere have: another scale
and frame rate, light, floor, rim, blur, sensor, perspective, codec, and a camera that moves.

Tested by ``test/simulation/plate_scene/test_drawn_camera.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import CompressionSettings, SceneSettings, SimulationSettings

if TYPE_CHECKING:
    from nanorocks_ros.experiment.trays import Tray

_FRAME_RATES = (15.0, 24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0)
_BAYER = ('none', 'rggb', 'grbg', 'gbrg', 'bggr')
# Codecs that are drawn with equal chances.
_CODECS = ('jpeg', 'h264_crf')
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraRanges:
    """Ranges from which a camera is drawn, uniformly unless stated otherwise.

    Parameters
    ----------
    scale : Range, [px/m]
        Logarithmically.
    frame_rate : Range, [1/s]
        The common rates within it.
    margin_px : Range, [px]
        Around the rim.
    lamp_elevation : Range, [rad]
        The azimuth is uniform over all directions.
    highlights, shadows, floor_shade, plate_shade, floor_texture : Range
    floor_texture_length : Range, [m]
        Logarithmically.
    rim_width : Range, [m]
    rim_shade : Range
    exposure : Range
        Part of the time between two frames.
    defocus_px : Range, [px]
    noise : Range, [gray levels]
    camera_height : Range, [m]
        Logarithmically; half of the cameras are infinitely far away.
    vignetting, gradient, flicker : Range
    crf, jpeg_quality : Range
        Of half of the cameras each.
    swing : Range, [m]
        Of the plates that swing.
    jitter_px, sway_px : Range, [px]
        Of the cameras that move.
    sway_frequency : Range, [1/s]
    """

    scale: Range = (6000.0, 25000.0)
    frame_rate: Range = (15.0, 120.0)
    margin_px: Range = (20.0, 50.0)
    lamp_elevation: Range = (0.6, 1.35)
    highlights: Range = (0.0, 1.5)
    shadows: Range = (0.0, 0.5)
    floor_shade: Range = (0.8, 1.25)
    plate_shade: Range = (0.5, 1.2)
    floor_texture: Range = (0.0, 0.06)
    floor_texture_length: Range = (0.0002, 0.003)
    rim_width: Range = (0.0004, 0.002)
    rim_shade: Range = (0.35, 1.2)
    exposure: Range = (0.05, 0.9)
    defocus_px: Range = (0.3, 1.5)
    noise: Range = (0.5, 4.0)
    camera_height: Range = (0.12, 1.0)
    vignetting: Range = (0.0, 0.3)
    gradient: Range = (0.0, 0.2)
    flicker: Range = (0.0, 0.02)
    crf: Range = (18.0, 28.0)
    jpeg_quality: Range = (70.0, 95.0)
    swing: Range = (0.00005, 0.0003)
    jitter_px: Range = (0.3, 2.0)
    sway_px: Range = (0.5, 2.5)
    sway_frequency: Range = (0.3, 1.5)


class DrawnCamera(NamedTuple):
    """A camera that was drawn at random.

    Parameters
    ----------
    simulation : SimulationSettings
        With the frame rate and the size of the picture.
    scene : SceneSettings
    compression : CompressionSettings
        `jpeg` or `h264_crf`.
    quality : int
        Of JPEGs.
    """

    simulation: SimulationSettings
    scene: SceneSettings
    compression: CompressionSettings
    quality: int


class _Draws:
    """Numbers drawn from the ranges, each from a stream of its own.

    A range that is added or changed leaves the others as they were.
    """

    def __init__(self, seed: int, ranges: CameraRanges) -> None:
        self._seed, self._ranges = seed, ranges

    def uniform(self, name: str, logarithmic: bool = False) -> float:
        low, high = getattr(self._ranges, name)
        share = self.share(name)
        if logarithmic:
            return float(low * (high / low) ** share)
        return float(low + (high - low) * share)

    def share(self, name: str) -> float:
        """Uniform in [0, 1)."""
        return float(np.random.default_rng([self._seed, *name.encode()]).random())

    def any_of(self, name: str, choices: tuple[str, ...]) -> str:
        return choices[int(self.share(name) * len(choices))]

    def frame_rate(self) -> float:
        low, high = self._ranges.frame_rate
        rates = [rate for rate in _FRAME_RATES if low <= rate <= high] or [low]
        return rates[int(self.share('frame_rate') * len(rates))]


def drawn_camera(
    seed: int,
    tray: Tray,
    simulation: SimulationSettings,
    *,
    ranges: CameraRanges | None = None,
    moving: float = 0.2,
) -> DrawnCamera:
    """Draw a camera that looks at one tray from near.

    Parameters
    ----------
    seed : int
        Of the camera alone; noise and texture have that of the simulation.
    tray : Tray
    simulation : SimulationSettings
        Of the gas; frame rate and size of the picture are replaced.
    ranges : CameraRanges, optional
    moving : float, 0 to 1
        Part of the cameras that jitter or sway, or do both.

    Raises
    ------
    ConfigurationError
        For ranges whose ends are in the wrong order.
    """
    ranges = ranges or CameraRanges()
    _check(ranges)
    draw = _Draws(seed, ranges)
    scene = _scene(draw, tray, moving)
    width, height = _even_sides(draw.uniform('margin_px'), tray, scene)
    filmed = replace(
        simulation,
        tray=tray.number,
        frame_rate=draw.frame_rate(),
        width_px=width,
        height_px=height,
    )
    compression = CompressionSettings(
        codec=draw.any_of('codec', _CODECS), crf=round(draw.uniform('crf'))
    )
    return DrawnCamera(filmed, scene, compression, round(draw.uniform('jpeg_quality')))


def _scene(draw: _Draws, tray: Tray, moving: float) -> SceneSettings:
    far = draw.share('far') < 0.5
    swings = draw.share('swings') < 0.5
    # Of the cameras that move, a third jitters, a third sways and a third does both.
    moves = draw.any_of('moves', ('jitter', 'sway', 'both'))
    still = draw.share('still') >= moving
    names = (
        'lamp_elevation',
        'highlights',
        'shadows',
        'floor_shade',
        'plate_shade',
        'floor_texture',
        'rim_width',
        'rim_shade',
        'exposure',
        'defocus_px',
        'noise',
        'vignetting',
        'gradient',
        'flicker',
    )
    uniform: dict[str, Any] = {name: draw.uniform(name) for name in names}
    return SceneSettings(
        **uniform,
        trays=(tray.number,),
        close_up=True,
        fisheye=0.0,
        glare=0.0,
        pixels_per_metre=draw.uniform('scale', logarithmic=True),
        lamp_azimuth=2.0 * math.pi * (draw.share('lamp_azimuth') - 0.5),
        floor_texture_length=draw.uniform('floor_texture_length', logarithmic=True),
        camera_height=0.0 if far else draw.uniform('camera_height', logarithmic=True),
        bayer=draw.any_of('bayer', _BAYER),
        swing=draw.uniform('swing') if swings else 0.0,
        swing_direction=2.0 * math.pi * (draw.share('swing_direction') - 0.5),
        camera_jitter_px=0.0 if still or moves == 'sway' else draw.uniform('jitter_px'),
        camera_sway_px=0.0 if still or moves == 'jitter' else draw.uniform('sway_px'),
        camera_sway_frequency=draw.uniform('sway_frequency'),
        camera_sway_direction=2.0 * math.pi * (draw.share('sway_direction') - 0.5),
    )


def _even_sides(margin: float, tray: Tray, scene: SceneSettings) -> tuple[int, int]:
    """Width and height, [px], of a picture of the tray, its rim and a margin."""
    height = scene.camera_height
    magnification = height / (height - tray.dimensions[2]) if height > 0.0 else 1.0
    across, down = (
        (side * magnification + 2.0 * scene.rim_width) * scene.pixels_per_metre + 2.0 * margin
        for side in tray.dimensions[:2]
    )
    return 2 * math.ceil(0.5 * across), 2 * math.ceil(0.5 * down)


def _check(ranges: CameraRanges) -> None:
    wrong = [
        f'{field.name} {getattr(ranges, field.name)}'
        for field in fields(ranges)
        if not getattr(ranges, field.name)[0] <= getattr(ranges, field.name)[1]
    ]
    if wrong:
        raise ConfigurationError('camera ranges', '; '.join(wrong), 'give the lower end first')
