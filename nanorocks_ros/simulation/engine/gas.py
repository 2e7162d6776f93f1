"""A granular gas of hard spheres in a box: followed from event to event, exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.simulation.engine.checks import check_beads, check_rules, check_times
from nanorocks_ros.simulation.engine.kernel import run_until
from nanorocks_ros.simulation.engine.prediction import predict_all
from nanorocks_ros.simulation.engine.state import DONE, Rules, new_state, snapshot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

# Hertz contact of two 2 mm acrylic beads that meet at 10 mm/s lasts about this long.
CONTACT_DURATION = 4e-5

MOST_EVENTS = 10_000_000

_COUNT_NAMES = ('pair', 'wall', 'elastic_pair', 'elastic_wall', 'stale', 'missed')


@dataclass(frozen=True, slots=True, kw_only=True)
class CollisionRules:
    """The box, and what a collision leaves of the normal velocity.

    Parameters
    ----------
    box : tuple of 3 floats, [m], > 0
        Sides; a corner is the origin.
    restitution, wall_restitution : float, 0 to 1
        Between beads, and at the six walls.
    contact_duration : float, [s], >= 0
        A contact is elastic when the last one of the same pair (or of the same bead and
        wall) was less than this ago; without it, inelastic collapse piles up events without
        end.

    Raises
    ------
    SimulationError
        For a value that cannot be used.
    """

    box: tuple[float, float, float]
    restitution: float = 1.0
    wall_restitution: float = 1.0
    contact_duration: float = CONTACT_DURATION

    def __post_init__(self) -> None:
        check_rules(self.compiled())

    def compiled(self) -> Rules:
        """The same for compiled code."""
        if len(self.box) != 3:
            raise SimulationError('box', f'{len(self.box)} sides', 'give three, in metres')
        x, y, z = (float(side) for side in self.box)
        return Rules(
            x,
            y,
            z,
            float(self.restitution),
            float(self.wall_restitution),
            float(self.contact_duration),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Beads:
    """Beads at one instant.

    Parameters
    ----------
    radii, masses : ndarray (n,), [m], [kg], > 0
    positions, velocities : ndarray (n, 3), [m], [m/s]
    """

    radii: NDArray[np.float64]
    masses: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class EventCounts:
    """How many events of each kind there were.

    Parameters
    ----------
    pair, wall : int
        Collisions of two beads, and of a bead with a wall.
    elastic_pair, elastic_wall : int
        Those among them made elastic by the contact duration.
    stale, missed : int
        Events taken but void: the partner had moved on, or a graze rounded to a miss.
    """

    pair: int
    wall: int
    elastic_pair: int
    elastic_wall: int
    stale: int
    missed: int


class HardSphereGas:
    """Inelastic hard spheres in a box.

    Parameters
    ----------
    beads : Beads
        At time 0; inside the box, not overlapping.
    rules : CollisionRules

    Raises
    ------
    SimulationError
        For beads that cannot be: NaN, no radius or mass, overlapping, larger than the box.
    """

    def __init__(self, beads: Beads, rules: CollisionRules) -> None:
        self._rules = rules.compiled()
        checked = check_beads(
            beads.radii, beads.masses, beads.positions, beads.velocities, self._rules
        )
        self._radii, self._masses, positions, velocities = checked
        self._state = new_state(positions, velocities, self._radii, self._masses)
        predict_all(self._state, self._rules, 0.0)

    @property
    def radii(self) -> NDArray[np.float64]:
        """Radius of each bead, (n,), [m]."""
        return self._radii.copy()

    @property
    def now(self) -> float:
        """How far the gas has been followed since the start or the last kick, [s]."""
        return float(self._state.clock[0])

    @property
    def counts(self) -> EventCounts:
        """Events so far."""
        return EventCounts(**dict(zip(_COUNT_NAMES, self._state.counts.tolist(), strict=True)))

    def run_until(
        self,
        end: float,
        frame_times: Sequence[float] | NDArray[np.float64] = (),
        most_events: int = MOST_EVENTS,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Follow the gas to a time.

        Parameters
        ----------
        end : float, [s]
            Not before `now`.
        frame_times : array_like (n_frames,), [s]
            Rising, from `now` to `end`.
        most_events : int
            Events of any kind before giving up.

        Returns
        -------
        positions, velocities : ndarray (n_frames, n, 3), [m], [m/s]
            At the frame times; an event at the very time of a frame belongs to it.

        Raises
        ------
        SimulationError
            When times go backwards, or after too many events; the gas can then still be
            followed further.
        """
        times = check_times(self.now, end, frame_times)
        shape = (times.size, self._radii.size, 3)
        positions, velocities = np.empty(shape), np.empty(shape)
        status = run_until(
            self._state, self._rules, float(end), int(most_events), times, positions, velocities
        )
        if status != DONE:
            raise SimulationError(
                'event-driven engine',
                f'{most_events} events taken and only {self.now:.6g} s of {end:.6g} s reached',
                'raise most_events, the contact duration or the restitution',
            )
        return positions, velocities

    def beads(self) -> Beads:
        """The beads as they are now."""
        positions, velocities = np.empty((2, self._radii.size, 3))
        snapshot(self._state, self.now, positions, velocities)
        return Beads(
            radii=self._radii.copy(),
            masses=self._masses.copy(),
            positions=positions,
            velocities=velocities,
        )

    def kick(self, velocities: ArrayLike) -> None:
        """Give every bead a new velocity where it is; time counts from 0 again.

        Parameters
        ----------
        velocities : array_like (n, 3), [m/s]

        Raises
        ------
        SimulationError
            For velocities of another shape, or not finite.
        """
        here = self.beads().positions
        checked = check_beads(
            self._radii, self._masses, here, velocities, self._rules, overlap=False
        )
        counts = self._state.counts
        self._state = new_state(here, checked[3], self._radii, self._masses)
        self._state.counts[:] = counts
        predict_all(self._state, self._rules, 0.0)
