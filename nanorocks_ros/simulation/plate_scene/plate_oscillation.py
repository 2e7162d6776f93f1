"""Damped oscillation of the plate on its springs after a shaking event.

Tested by ``test/simulation/plate_scene/test_plate_camera.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

if TYPE_CHECKING:
    from nanorocks_ros.settings import SceneSettings, SimulationSettings


class PlateMotion(NamedTuple):
    """Displacement and velocity of the plate, along columns and rows of the picture.

    Parameters
    ----------
    displacement : tuple of 2 floats, [m]
        From its place at rest.
    velocity : tuple of 2 floats, [m/s]
    """

    displacement: tuple[float, float]
    velocity: tuple[float, float]


AT_REST = PlateMotion((0.0, 0.0), (0.0, 0.0))


def wall_motion_of(simulation: SimulationSettings, scene: SceneSettings) -> WallMotion | None:
    """Wall motion after each shaking event, for the gas; None for a plate at rest.

    It ends after a whole number of periods, so that the displacement is 0 at the next event.
    """
    periods = math.floor(simulation.shake_period * scene.swing_frequency)
    if scene.swing == 0.0 or periods < 1:
        return None
    across = scene.swing * math.cos(scene.swing_direction)
    down = scene.swing * math.sin(scene.swing_direction)
    return WallMotion(
        amplitude=(across, down, 0.0),
        angular_frequency=2.0 * math.pi * scene.swing_frequency,
        damping=scene.swing_damping,
        end=periods / scene.swing_frequency,
    )


def plate_motion(motion: WallMotion | None, since: float | None) -> PlateMotion:
    """Motion of the plate some time after a shaking event.

    Parameters
    ----------
    motion : WallMotion or None
    since : float or None, [s]
        None before the first event.
    """
    if motion is None or since is None or not 0.0 <= since < motion.end:
        return AT_REST
    omega = motion.angular_frequency
    envelope = math.exp(-motion.damping * since)
    sine, cosine = math.sin(omega * since), math.cos(omega * since)
    shape, change = envelope * sine, envelope * (omega * cosine - motion.damping * sine)
    across, down = motion.amplitude[:2]
    return PlateMotion((across * shape, down * shape), (across * change, down * change))
