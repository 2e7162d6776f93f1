"""Film of a simulated tray, with the ground truth of every frame.

Tested by ``test/simulation/tray_camera/test_tray_renderer.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nanorocks_ros.records import Frame
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import GroundTruth
    from nanorocks_ros.settings import SimulationSettings


def film(
    settings: SimulationSettings,
    tray: Tray,
    frames: int | None = None,
    *,
    start_stamp_ns: int = 0,
) -> Iterator[tuple[Frame, GroundTruth]]:
    """Film a simulated tray; each frame is computed on demand.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    frames : int or None, >= 0
        How many; None for an endless film.
    start_stamp_ns : int, [ns]
        Stamp of the first frame.

    Returns
    -------
    iterator of (Frame, GroundTruth)
        Frames are ``bgr8``.

    Raises
    ------
    ConfigurationError
        For a setting outside its range.
    SimulationError
        When the beads do not fit into the tray, or the tray into the picture.
    """
    shaken = ShakenTray(settings, tray)
    camera = TrayCamera(settings, tray, shaken.radii, shaken.materials)
    return _frames(shaken, camera, frames, start_stamp_ns)


def _frames(
    shaken: ShakenTray, camera: TrayCamera, frames: int | None, start_stamp_ns: int
) -> Iterator[tuple[Frame, GroundTruth]]:
    for number, moment in enumerate(shaken.moments(frames, start_stamp_ns)):
        image = camera.picture(moment.positions, number)
        yield Frame(stamp_ns=moment.truth.stamp_ns, encoding='bgr8', image=image), moment.truth
