"""Film of all trays of the plate, shaken together, with the true state of every bead."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.records import BeadsTruth, Frame, GroundTruth
from nanorocks_ros.settings import with_values
from nanorocks_ros.simulation.initial_state import inventory
from nanorocks_ros.simulation.plate_scene.drawing.bead_appearance import turned_angle
from nanorocks_ros.simulation.plate_scene.optics.camera_shake import CameraShake
from nanorocks_ros.simulation.plate_scene.optics.shutter import (
    MOST,
    grouped_path,
    instants_for,
    shutter_times,
)
from nanorocks_ros.simulation.plate_scene.plate_camera import Instant, SceneCamera
from nanorocks_ros.simulation.plate_scene.plate_oscillation import plate_motion, wall_motion_of
from nanorocks_ros.simulation.plate_scene.scene_checks import check_motion, check_scene
from nanorocks_ros.simulation.shaken_tray import ShakenTray, check_settings

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SceneSettings, SimulationSettings
    from nanorocks_ros.simulation.plate_scene.plate_oscillation import PlateMotion

    _States = Mapping[int, tuple[np.ndarray, np.ndarray]]

_NS = 1e9

_EFFECTS: tuple[str, ...] = (
    'fisheye',
    'defocus_px',
    'noise',
    'vignetting',
    'gradient',
    'flicker',
    'shadows',
    'chalk',
    'glare',
    'ovality',
    'irregularity',
    'turning',
    'swing',
    'floor_texture',
    'rim_width',
    'camera_height',
    'exposure',
    'camera_jitter_px',
    'camera_sway_px',
)


def without_effects(scene: SceneSettings) -> SceneSettings:
    """The settings without effects: perfect camera, plate at rest, even light, clean round beads.

    Beads are still shaded, as in a film of a single tray.
    """
    return with_values(scene, dict.fromkeys(_EFFECTS, 0.0), 'no effects')


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneMoment:
    """One frame of the scene and its ground truth.

    Parameters
    ----------
    frame : Frame
        ``bgr8``.
    trays : tuple of GroundTruth
        Of each tray; speeds relative to the camera.
    beads : tuple of BeadsTruth
        Of each tray; relative to its floor.
    shift_px : tuple of 2 floats, [px]
        By which the camera has moved the whole picture.
    """

    frame: Frame
    trays: tuple[GroundTruth, ...]
    beads: tuple[BeadsTruth, ...]
    shift_px: tuple[float, float] = (0.0, 0.0)


class SceneFilm:
    """A film of the plate; each frame is computed on demand.

    Parameters
    ----------
    simulation : SimulationSettings
        Of the gas in every tray, the size of the pictures and the seed; `tray`, the scale and
        the noise are not used.
    scene : SceneSettings
    trays : mapping of int to Tray, optional
        All cells of the plate; by default those that were flown.
    gases : mapping of int to SimulationSettings, optional
        Settings of trays that differ; seed, shaking events and camera are shared.

    Raises
    ------
    ConfigurationError
        For a setting outside its range, or trays that do not fit together.
    SimulationError
        When beads do not fit into their tray.
    """

    def __init__(
        self,
        simulation: SimulationSettings,
        scene: SceneSettings,
        trays: Mapping[int, Tray] | None = None,
        gases: Mapping[int, SimulationSettings] | None = None,
    ) -> None:
        gas_settings = {
            number: _with_shared_settings(simulation, (gases or {}).get(number, simulation))
            for number in scene.trays
        }
        check_scene(scene)
        for checked in (simulation, *gas_settings.values()):
            check_settings(checked)
            check_motion(checked, scene)
        self._simulation, self._scene = simulation, scene
        self._fastest = 0.0
        self._shake = CameraShake(scene, simulation.seed)
        cells = dict(trays or load_trays())
        self._swing = wall_motion_of(simulation, scene)
        self._gases = {
            number: _shaken_tray(gas_settings[number], scene, tray_by_number(cells, number))
            for number in sorted(scene.trays)
        }
        self._species = {number: inventory(cells[number]).species for number in self._gases}
        radii = {number: gas.radii for number, gas in self._gases.items()}
        self.camera = SceneCamera(simulation, scene, cells, radii)

    def moments(self, frames: int | None = None, start_stamp_ns: int = 0) -> Iterator[SceneMoment]:
        """Iterate over the frames; to be called once.

        Parameters
        ----------
        frames : int or None, >= 0
            How many; None for an endless film.
        start_stamp_ns : int, [ns]
            Stamp of the first frame.

        Raises
        ------
        SimulationError
            For less than no frames.
        """
        if frames is not None and frames < 0:
            raise SimulationError('frames', f'{frames}', 'give 0 or more')
        return self._moments(count() if frames is None else range(frames), start_stamp_ns)

    def _moments(self, numbers: Iterable[int], start_stamp_ns: int) -> Iterator[SceneMoment]:
        for number in numbers:
            stamp_ns = start_stamp_ns + round(number * _NS / self._simulation.frame_rate)
            yield self.at(number, stamp_ns)

    def at(self, number: int, stamp_ns: int) -> SceneMoment:
        """The frame of a number; numbers must rise from call to call.

        Raises
        ------
        SimulationError
            When that frame has passed already.
        """
        time = number / self._simulation.frame_rate
        before, after = shutter_times(time, *self._exposure(time))
        instants = [self._instant(instant, number)[0] for instant in before]
        instant, states, motion = self._instant(time, number)
        turned = turned_angle(time, self._events())
        beads = tuple(self._truth(tray, stamp_ns, state, motion) for tray, state in states.items())
        trays = tuple(
            self._gases[tray].truth(stamp_ns, velocities)
            for tray, (_, velocities) in states.items()
        )
        instants += [instant, *(self._instant(later, number)[0] for later in after)]
        self._fastest = max(float(np.abs(state[1][:, :2]).max()) for state in states.values())
        shown = _with_fewer_plates(instants, self._scene.pixels_per_metre)
        image = self.camera.exposed(shown, number, time=time, turned=turned)
        frame = Frame(stamp_ns=stamp_ns, encoding='bgr8', image=image)
        shift = instant.shift
        return SceneMoment(frame=frame, trays=trays, beads=beads, shift_px=shift)

    def _exposure(self, time: float) -> tuple[float, int]:
        """How long the shutter is open for a frame, [s], and the number of instants to draw."""
        opened = self._scene.exposure / self._simulation.frame_rate
        if opened == 0.0:
            return 0.0, 1
        # The speeds of the frame before say nothing when there was an event since.
        if self._shaken_within(time - 1.0 / self._simulation.frame_rate, time + 0.5 * opened):
            return opened, MOST
        return opened, instants_for(self._fastest * self._scene.pixels_per_metre * opened)

    def _shaken_within(self, start: float, end: float) -> bool:
        first, period = self._simulation.first_shake, self._simulation.shake_period
        return end >= first and math.floor((end - first) / period) > (start - first) / period

    def _instant(self, time: float, number: int) -> tuple[Instant, _States, PlateMotion]:
        states = {tray: gas.at(time) for tray, gas in self._gases.items()}
        motion = self._motion(time)
        positions = {tray: state[0] for tray, state in states.items()}
        shift = self._shake.shift(number, time)
        return Instant(positions, motion.displacement, shift), states, motion

    def _motion(self, time: float) -> PlateMotion:
        events = self._events()
        # A frame at the time of the event, within rounding, shows the tray after it.
        since = max(time - events[-1], 0.0) if events else None
        return plate_motion(self._swing, since)

    def _events(self) -> list[float]:
        """Shaking events so far, [s]."""
        cycle = next(iter(self._gases.values())).cycle
        first, period = self._simulation.first_shake, self._simulation.shake_period
        return [first + k * period for k in range(cycle)]

    def drag(self, tray: int) -> np.ndarray:
        """Rate at which the gas slows each bead of a tray, (n,), [1/s]; 0 in a vacuum."""
        return self._gases[tray].drag

    def _truth(
        self, tray: int, stamp_ns: int, state: tuple[np.ndarray, np.ndarray], motion: PlateMotion
    ) -> BeadsTruth:
        gas = self._gases[tray]
        displacement, velocity = np.array(motion.displacement), np.array(motion.velocity)
        return BeadsTruth(
            stamp_ns=stamp_ns,
            tray=tray,
            cycle=gas.cycle,
            displacement=displacement,
            tray_velocity=velocity,
            positions=state[0] - np.append(displacement, 0.0),
            velocities=state[1] - np.append(velocity, 0.0),
            radii=gas.radii,
            species=self._species[tray],
            bodies=gas.bodies,
        )


def _with_fewer_plates(instants: list[Instant], scale: float) -> list[Instant]:
    """The instants with plates that are drawn once for several of them."""
    if len(instants) == 1:
        return [instants[0]._replace(plate_shift=instants[0].shift)]
    plates = grouped_path(scale * np.array([instant.plate for instant in instants])) / scale
    shifts = grouped_path(np.array([instant.shift for instant in instants]))
    return [
        instant._replace(plate=(plate[0], plate[1]), plate_shift=(shift[0], shift[1]))
        for instant, plate, shift in zip(instants, plates.tolist(), shifts.tolist(), strict=True)
    ]


def _with_shared_settings(
    simulation: SimulationSettings, gas_settings: SimulationSettings
) -> SimulationSettings:
    """Settings of one tray, with the values that all trays of a film share."""
    names = ('seed', 'first_shake', 'shake_period', 'frame_rate', 'width_px', 'height_px')
    return replace(gas_settings, **{name: getattr(simulation, name) for name in names})


def _shaken_tray(simulation: SimulationSettings, scene: SceneSettings, tray: Tray) -> ShakenTray:
    # The number of the tray is its run, so that trays with the same beads differ.
    swing = wall_motion_of(simulation, scene) if scene.swing_knocks else None
    settings = replace(simulation, tray=tray.number)
    return ShakenTray(settings, tray, run=tray.number, swing=swing)
