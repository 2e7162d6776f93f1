"""A tray that accelerates steadily, with the camera fixed to it: residual gravity.

The engine knows no gravity, but walls that move. From frame to frame the tray moves as
sqrt(3) A (d t - d² t² + (d t)⁴/3 ...), a damped sine of angular frequency sqrt(3) d: its
acceleration is constant but for 2 (d t)² of it. The beads get its first velocity besides, and
after each frame positions and velocities are again those relative to the tray.

Tested by ``test/validation/test_accelerated_tray.py``.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion
from nanorocks_ros.simulation.initial_state import resting_beads, rules_of
from nanorocks_ros.simulation.shaken_tray import Moment, ShakenTray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings

_NS = 1e9
# Damping times the time between frames.
_DAMPED = 0.003


class AcceleratedTray:
    """Smooth beads that cool after a shaking event at time 0, all with one acceleration.

    Parameters
    ----------
    settings : SimulationSettings
        With `first_shake` 0.
    tray : Tray
    run : int
        Starts as the same run without acceleration.
    acceleration : tuple of 3 floats, [m/s^2]
        Of free beads relative to the tray.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        tray: Tray,
        run: int,
        acceleration: tuple[float, float, float],
    ) -> None:
        self._interval = 1.0 / settings.frame_rate
        self._shaken = ShakenTray(settings, tray, run)
        positions, velocities = self._shaken.at(0.0)
        self._beads = replace(
            resting_beads(settings, tray, run), positions=positions, velocities=velocities
        )
        damping = _DAMPED / self._interval
        # First velocity of the tray.
        self._boost = np.array(acceleration) / (2.0 * damping)
        x, y, z = (self._boost / (math.sqrt(3.0) * damping)).tolist()
        self._motion = WallMotion(
            amplitude=(x, y, z), angular_frequency=math.sqrt(3.0) * damping, damping=damping
        )
        self._gas = HardSphereGas(
            self._boosted(), replace(rules_of(settings, tray, run), motion=self._motion)
        )

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._beads.radii

    def _boosted(self) -> Beads:
        return replace(self._beads, velocities=self._beads.velocities + self._boost)

    def moments(self, frames: int) -> Iterator[Moment]:
        """Iterate over the frames, relative to the tray; to be called once."""
        for number in range(frames):
            stamp_ns = round(number * self._interval * _NS)
            truth = self._shaken.truth(stamp_ns, self._beads.velocities)
            yield Moment(
                positions=self._beads.positions, velocities=self._beads.velocities, truth=truth
            )
            self._advance()

    def _advance(self) -> None:
        """Follow the beads to the next frame."""
        positions, velocities = self._gas.run_until(self._interval, [self._interval])
        phase = _DAMPED * complex(-1.0, math.sqrt(3.0))
        wave = cmath.exp(phase)
        amplitude = np.array(self._motion.amplitude)
        rate = phase / self._interval
        self._beads = replace(
            self._beads,
            positions=positions[0] - amplitude * wave.imag,
            velocities=velocities[0] - amplitude * (rate * wave).imag,
        )
        self._gas.restart(self._boosted())
