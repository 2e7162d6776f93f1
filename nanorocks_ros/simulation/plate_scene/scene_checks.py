"""Checks of the settings of a scene before it is drawn.

Tested by ``test/simulation/plate_scene/test_plate_film.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.settings import IN_RANGE, problem, rows
from nanorocks_ros.simulation.plate_scene.close_up_plate import FURTHEST_SHIFT
from nanorocks_ros.simulation.plate_scene.moving_plate import FURTHEST_PX
from nanorocks_ros.simulation.plate_scene.optics.camera_shake import FURTHEST_JITTER

if TYPE_CHECKING:
    from nanorocks_ros.settings import SceneSettings, SimulationSettings


def check_motion(simulation: SimulationSettings, scene: SceneSettings) -> None:
    """Refuse an oscillation, or a motion of the camera, that cannot be drawn or simulated.

    Raises
    ------
    ConfigurationError
        Naming the setting at fault.
    """
    furthest = FURTHEST_PX / scene.pixels_per_metre
    if scene.swing >= furthest:
        raise ConfigurationError(
            'swing',
            f'{scene.swing:g} m is {FURTHEST_PX} px or more in the picture',
            f'give less than {furthest:.3g} m',
        )
    if scene.swing > 0.0 and simulation.wall_sticking_speed > 0.0:
        raise ConfigurationError(
            'wall_sticking_speed',
            f'{simulation.wall_sticking_speed:g} m/s, but beads cannot stick to walls that swing',
            'set it or the swing to 0',
        )
    moved = (
        scene.swing * scene.pixels_per_metre
        + FURTHEST_JITTER * scene.camera_jitter_px
        + scene.camera_sway_px
    )
    if moved >= FURTHEST_SHIFT:
        raise ConfigurationError(
            'camera_jitter_px',
            f'{scene.camera_jitter_px:g} px, with sway and swing up to {moved:.3g} px, is more '
            f'than can be drawn ({FURTHEST_SHIFT} px)',
            'give less of camera_jitter_px, camera_sway_px or swing',
        )


def check_scene(scene: SceneSettings) -> None:
    """Refuse settings outside their ranges, all at once.

    Raises
    ------
    ConfigurationError
        Naming every setting at fault.
    """
    problems = ((row.name, problem(row, row.default)) for row in rows(scene))
    wrong = [f'{name}: {text}' for name, text in problems if text]
    if not scene.trays or len(set(scene.trays)) != len(scene.trays):
        wrong.append(f'trays: {scene.trays} is empty or has duplicates')
    if wrong:
        raise ConfigurationError('scene', '; '.join(wrong), IN_RANGE)
