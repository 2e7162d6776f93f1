"""A film of one tray by a camera drawn at random: a video file, and the truth beside it.

Tested by ``test/studies/synthetic/test_drawn_film.py``.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.simulation.plate_scene.drawn_camera import DrawnCamera, drawn_camera
from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm
from nanorocks_ros.studies.synthetic.film_video import VideoQuality, images_into_video

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import BeadsTruth
    from nanorocks_ros.settings import SimulationSettings

    _Truth = tuple[BeadsTruth, tuple[float, float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFilm:
    """A film that was written, and its truth.

    Parameters
    ----------
    video, truth : Path
        The video, and the truth as NPZ.
    camera : DrawnCamera
    frame_rate : float, [1/s]
    scale : float, [px/m]
        On the floor.
    region : tuple of 4 floats, [px]
        Left, top, width and height of the floor while tray and camera are at rest.
    first_shake : float, [s]
        From the first frame.
    time : ndarray (frames,), [s]
        From the first frame.
    cycle : ndarray of int, (frames,)
        Shaking events so far.
    speed : ndarray (frames,), [m/s]
        Mean projected speed of the beads relative to the tray.
    camera_speed : ndarray (frames,), [m/s]
        The same past the camera's place at rest.
    positions, velocities : ndarray of float32, (frames, beads, 3), [m], [m/s]
        From the corner of the floor with the tray at rest; of the beads alone, whatever tray and
        camera do. Relative to the tray: `positions` minus `displacement`.
    displacement : ndarray (frames, 2), [m]
        Of the tray.
    shift_px : ndarray (frames, 2), [px]
        By which the camera has moved the whole picture.
    bodies : ndarray of int, (frames, beads)
        The smallest number of a bead in the body of each bead.
    radii : ndarray (beads,), [m]
    species : ndarray of int, (beads,)
    drag : ndarray (beads,), [1/s]
        Rate at which the gas slows each bead; 0 in a vacuum.
    """

    video: Path
    truth: Path
    camera: DrawnCamera
    frame_rate: float
    scale: float
    region: tuple[float, float, float, float]
    first_shake: float
    time: NDArray[np.float64]
    cycle: NDArray[np.int32]
    speed: NDArray[np.float64]
    camera_speed: NDArray[np.float64]
    positions: NDArray[np.float32]
    velocities: NDArray[np.float32]
    displacement: NDArray[np.float64]
    shift_px: NDArray[np.float64]
    bodies: NDArray[np.int32]
    radii: NDArray[np.float64]
    species: NDArray[np.int32]
    drag: NDArray[np.float64]


def write_drawn_film(
    path: Path,
    tray: Tray,
    simulation: SimulationSettings,
    seconds: float,
    seed: int,
    *,
    moving: bool | float = False,
) -> DrawnFilm:
    """Film a tray with a camera drawn at random, into a video with its truth beside it.

    Parameters
    ----------
    path : Path
        Without suffix: ``.mp4`` or ``.avi``, by the drawn codec, and ``.npz`` are added.
    tray : Tray
        With its true dimensions, beads and sizes.
    simulation : SimulationSettings
        The gas: restitutions, speeds, shaking events, seed of the gas and of the noise. Frame rate
        and size of the picture are drawn.
    seconds : float, [s], > 0
    seed : int
        Of the camera.
    moving : bool or float
        Whether cameras jitter or sway; a number is the part of the cameras that do.

    Raises
    ------
    ConfigurationError, SimulationError
        When this cannot be filmed, or PyAV is not installed.
    RecordingError
        When the video cannot be written.
    """
    camera = drawn_camera(seed, tray, simulation, moving=float(moving))
    return write_film(path, tray, camera, seconds)


def write_film(path: Path, tray: Tray, camera: DrawnCamera, seconds: float) -> DrawnFilm:
    """The same with a camera that is given; see `write_drawn_film`."""
    frames = max(1, round(seconds * camera.simulation.frame_rate))
    film = SceneFilm(camera.simulation, camera.scene, {tray.number: tray})
    truths: list[_Truth] = []

    def images() -> Iterator[NDArray[np.uint8]]:
        for moment in film.moments(frames):
            truths.append((moment.beads[0], moment.shift_px))
            yield moment.frame.image

    suffix = '.avi' if camera.compression.codec == 'jpeg' else '.mp4'
    video = path.with_name(path.name + suffix)
    quality = VideoQuality(crf=camera.compression.crf, jpeg=camera.quality)
    images_into_video(
        video, camera.simulation, images(), frames=frames, progress=_silent, quality=quality
    )
    geometry = film.camera.geometry
    corner, sides = geometry.corner(tray.number), geometry.sides(tray.number)
    drawn = _film(
        truths,
        video=video,
        truth=path.with_name(path.name + '.npz'),
        camera=camera,
        drag=film.drag(tray.number),
        region=(float(corner[0]), float(corner[1]), *sides),
    )
    _save(drawn, tray)
    return drawn


def _silent(done: int, frames: int) -> None:
    """Progress that nobody is shown."""


def _film(truths: list[_Truth], **known: Any) -> DrawnFilm:
    """The film, given the truth of each frame."""
    beads = [truth for truth, _ in truths]
    displacement = np.array([truth.displacement for truth in beads])
    tray_velocity = np.array([truth.tray_velocity for truth in beads])
    relative = np.array([truth.velocities for truth in beads])
    free = relative[:, :, :2] + tray_velocity[:, np.newaxis]
    positions = np.array([truth.positions for truth in beads])
    positions[:, :, :2] += displacement[:, np.newaxis]
    velocities = np.concatenate([free, relative[:, :, 2:]], axis=2)
    camera: DrawnCamera = known['camera']
    rate = camera.simulation.frame_rate
    return DrawnFilm(
        **known,
        frame_rate=rate,
        scale=camera.scene.pixels_per_metre,
        first_shake=camera.simulation.first_shake,
        time=np.arange(len(truths)) / rate,
        cycle=np.array([truth.cycle for truth in beads], dtype=np.int32),
        speed=np.hypot(relative[..., 0], relative[..., 1]).mean(axis=1),
        camera_speed=np.hypot(free[..., 0], free[..., 1]).mean(axis=1),
        positions=positions.astype(np.float32),
        velocities=velocities.astype(np.float32),
        displacement=displacement,
        shift_px=np.array([shift for _, shift in truths]),
        bodies=np.array([truth.bodies for truth in beads], dtype=np.int32),
        radii=np.array(beads[0].radii),
        species=np.array(beads[0].species),
    )


def _save(film: DrawnFilm, tray: Tray) -> None:
    """Write the truth under short names."""
    camera = film.camera
    settings = {
        'simulation': asdict(camera.simulation),
        'scene': asdict(camera.scene),
        'compression': asdict(camera.compression),
        'quality': camera.quality,
    }
    np.savez_compressed(
        film.truth,
        P=film.positions,
        V=film.velocities,
        D=film.displacement,
        C=film.shift_px,
        B=film.bodies.astype(np.int16),
        rad=film.radii,
        sp=film.species,
        drag=film.drag,
        box=np.array(tray.dimensions),
        merges=_merges(film),
        fps=film.frame_rate,
        pre=film.first_shake,
        tray=tray.number,
        scale=film.scale,
        region=np.array(film.region),
        speed=film.speed,
        settings=json.dumps(settings),
    )


def _merges(film: DrawnFilm) -> NDArray[np.float64]:
    """Rows of time since the first shaking event [s] and the lowest beads of two joined bodies."""
    merges = []
    for number in np.flatnonzero((np.diff(film.bodies, axis=0) != 0).any(axis=1)):
        before, after = film.bodies[number], film.bodies[number + 1]
        for body in np.unique(before[before > after]):
            other = after[np.flatnonzero(before == body)[0]]
            merges.append((film.time[number + 1] - film.first_shake, other, body))
    return np.array(merges, dtype=np.float64).reshape(-1, 3)
