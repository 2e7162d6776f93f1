"""A tray that is shaken at set times and cools in between, frame by frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, SimulationError
from nanorocks_ros.numerics.counter_rng import Purpose, key_for
from nanorocks_ros.records import GroundTruth
from nanorocks_ros.settings import IN_RANGE, problem, rows
from nanorocks_ros.simulation.engine.beads import Beads
from nanorocks_ros.simulation.engine.event_counts import EventCounts
from nanorocks_ros.simulation.engine.gas import HardSphereGas
from nanorocks_ros.simulation.initial_state import (
    draw_velocities,
    inventory,
    resting_beads,
    rules_of,
    wall_motion,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import SimulationSettings
    from nanorocks_ros.simulation.engine.rules.collision_rules import CollisionRules
    from nanorocks_ros.simulation.engine.rules.wall_motion import WallMotion

# A frame this much before a shaking event shows it: decimal times are not exact in binary.
_SIMULTANEOUS = 1e-9

_NS = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """The beads at the instant of one frame.

    Parameters
    ----------
    positions, velocities : ndarray (n, 3), [m], [m/s]
        From the corner of the tray.
    truth : GroundTruth
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    truth: GroundTruth


class ShakenTray:
    """Beads in a tray: at rest, shaken at set times, cooling freely in between.

    Parameters
    ----------
    settings : SimulationSettings
    tray : Tray
    run : int, >= 0
        Runs of one seed differ.
    swing : WallMotion, optional
        Motion of the walls after each shaking event; by default they are at rest.

    Raises
    ------
    ConfigurationError
        For a setting outside its range.
    SimulationError
        When the beads do not fit into the tray.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        tray: Tray,
        run: int = 0,
        swing: WallMotion | None = None,
    ) -> None:
        check_settings(settings)
        self._settings = settings
        self._tray = tray
        self.materials = inventory(tray).materials
        self._run = run
        self._rules = rules_of(settings, tray, run)
        self._swing = swing
        self._gas = HardSphereGas(resting_beads(settings, tray, run), self._rules)
        self._origin = 0.0
        self._cycle = 0

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._gas.radii

    @property
    def drag(self) -> NDArray[np.float64]:
        """Rate at which the gas slows each bead, (n,), [1/s]; 0 in a vacuum."""
        return np.zeros(self.radii.size) if self._gas.drag is None else self._gas.drag

    @property
    def cycle(self) -> int:
        """Shaking events so far."""
        return self._cycle

    @property
    def bodies(self) -> NDArray[np.int32]:
        """The smallest number of a bead in the body of each bead, (n,)."""
        return self._gas.bodies

    @property
    def origin(self) -> float | None:
        """Time of the last shaking event, [s]; None before the first."""
        return self._origin if self._cycle else None

    @property
    def counts(self) -> EventCounts:
        """Events so far."""
        return self._gas.counts

    def moments(self, frames: int | None = None, start_stamp_ns: int = 0) -> Iterator[Moment]:
        """Iterate over the frames from the present on; to be called once.

        Parameters
        ----------
        frames : int or None, >= 0
            How many; None for an endless film.
        start_stamp_ns : int, [ns]
            Stamp of the frame at time 0.

        Raises
        ------
        SimulationError
            When time would go backwards.
        """
        if frames is not None and frames < 0:
            raise SimulationError('frames', f'{frames}', 'give 0 or more')
        return self._moments(count() if frames is None else range(frames), start_stamp_ns)

    def _moments(self, numbers: count[int] | range, start_stamp_ns: int) -> Iterator[Moment]:
        for number in numbers:
            positions, velocities = self.at(number / self._settings.frame_rate)
            stamp_ns = start_stamp_ns + round(number * _NS / self._settings.frame_rate)
            yield Moment(
                positions=positions,
                velocities=velocities,
                truth=self.truth(stamp_ns, velocities),
            )

    def at(self, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Advance the beads to a time, through the shaking events up to and including it.

        Parameters
        ----------
        time : float, [s]

        Returns
        -------
        positions, velocities : ndarray (n, 3), [m], [m/s]

        Raises
        ------
        SimulationError
            When the time has passed already.
        """
        while time >= self._next_shake() - _SIMULTANEOUS:
            self._shake()
        # A frame at the time of the event, within rounding, shows the tray after it.
        since = max(time - self._origin, 0.0) if self._cycle else time
        positions, velocities = self._gas.run_until(since, [since])
        return positions[0], velocities[0]

    def _next_shake(self) -> float:
        return self._settings.first_shake + self._cycle * self._settings.shake_period

    def _shake(self) -> None:
        instant = self._next_shake()
        self._gas.run_until(max(instant - self._origin, self._gas.now))
        shaken = after_shaking(
            self._settings, self._rules, self._gas.beads(), self._run, self._cycle
        )
        if self._swing is not None and self._cycle == 0:
            # Nothing has moved before: a new gas whose walls oscillate from its time 0 on.
            moving = replace(self._rules, motion=self._swing)
            self._gas = HardSphereGas(shaken, moving)
        else:
            self._gas.restart(shaken)
        self._origin = instant
        self._cycle += 1

    def truth(self, stamp_ns: int, velocities: NDArray[np.float64]) -> GroundTruth:
        """Ground truth at the present time, given the velocities (n, 3), [m/s]."""
        mean_speed, mean_projected_speed = mean_speeds(velocities)
        return GroundTruth(
            stamp_ns=stamp_ns,
            tray=self._tray.number,
            cycle=self._cycle,
            mean_projected_speed=mean_projected_speed,
            mean_speed=mean_speed,
            bodies=np.unique(self._gas.bodies).size,
            restitution=self._settings.restitution,
            wall_restitution=self._settings.wall_restitution,
            sticking_speed=self._settings.sticking_speed,
        )


def after_shaking(
    settings: SimulationSettings, rules: CollisionRules, beads: Beads, run: int, cycle: int
) -> Beads:
    """The beads of a tray at the end of a shaking event, with no bodies.

    Parameters
    ----------
    settings : SimulationSettings
    rules : CollisionRules
    beads : Beads
        Before it.
    run, cycle : int, >= 0
        Runs of a seed differ, and so do the shaking events of a run.

    Returns
    -------
    Beads
        At their old positions, with random velocities. With `speeds` shaken the walls are moved:
        then at the positions that this gives, with its velocities times one factor that sets the
        mean speed; with constant restitution this equals a faster shaking.

    Raises
    ------
    SimulationError
        When the simulation of the shaking fails.
    """
    key = key_for(settings.seed, run, Purpose.VELOCITIES)
    maxwell = settings.speeds == 'maxwellian'
    vertical = settings.vertical_speed_factor
    velocities = draw_velocities(beads.masses, settings.mean_speed, maxwell, vertical, key, cycle)
    started = replace(beads, velocities=velocities, spins=None)
    if settings.speeds != 'shaken' or settings.mean_speed == 0.0:
        return started
    motion = wall_motion(settings)
    apart = replace(
        rules,
        sticking_speed=0.0,
        sticking_speed_width=0.0,
        wall_sticking_speed=0.0,
        break_up_speed=0.0,
        motion=motion,
    )
    gas = HardSphereGas(started, apart)
    gas.run_until(motion.end)
    shaken = gas.beads()
    factor = settings.mean_speed / mean_speeds(shaken.velocities)[0]
    return replace(
        shaken,
        velocities=factor * shaken.velocities,
        spins=None if shaken.spins is None else factor * shaken.spins,
    )


def mean_speeds(velocities: NDArray[np.float64]) -> tuple[float, float]:
    """Mean speed in space and in the image plane, [m/s], of velocities (n, 3)."""
    squares = velocities * velocities
    in_plane = squares[:, 0] + squares[:, 1]
    # fsum rounds once: the same sum whatever the number of lanes of the machine.
    in_space = math.fsum(np.sqrt(in_plane + squares[:, 2]).tolist())
    n = velocities.shape[0]
    return in_space / n, math.fsum(np.sqrt(in_plane).tolist()) / n


def check_settings(settings: SimulationSettings) -> None:
    """Refuse settings outside their ranges, all at once.

    Raises
    ------
    ConfigurationError
        Naming every setting at fault.
    """
    problems = ((row.name, problem(row, row.default)) for row in rows(settings))
    wrong = [f'{name}: {text}' for name, text in problems if text]
    if wrong:
        raise ConfigurationError('simulation', '; '.join(wrong), IN_RANGE)
