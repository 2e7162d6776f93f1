"""A slow, simple event-driven engine: each step checks all pairs and moves all beads.

It stores nothing between events but the physical state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .bodies import Bodies
from .collisions import normal_impulse, pair_restitution, slip, tangential_impulse
from .search import next_contact
from .tray import Tray, axis_of, inward_of


@dataclass(frozen=True)
class Event:
    """An event; `kind` is 'pair', 'wall', 'merge' or 'fix'.

    `partner` is the higher bead of the pair, or the wall; `speed` the normal approach speed
    before; `impulse` the magnitude of the impulse vector.
    """

    time: float
    kind: str
    i: int
    partner: int
    speed: float
    impulse: float


@dataclass
class Ledger:
    """Energy and momentum that left the beads.

    `wall_impulse` and `fixed_impulse` are the momentum vectors given to each wall and to fixed
    bodies; `wall_momentum` is the component of the former along the axis of each wall.
    """

    energy_lost_in_pairs: float = 0.0
    energy_lost_at_walls: float = 0.0
    energy_lost_in_merges: float = 0.0
    wall_impulse: np.ndarray = field(default_factory=lambda: np.zeros((6, 3)))
    fixed_impulse: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def wall_momentum(self):
        return np.array([self.wall_impulse[wall, axis_of(wall)] for wall in range(6)])


class ReferenceGas:
    """Hard spheres in a box, by the rules alone."""

    def __init__(self, radii, masses, positions, velocities, rules, spins=None, species=None):
        check(rules, spins)
        self.beads = Bodies(radii, masses, positions, velocities, spins)
        self.species = [0] * len(self.beads.radii) if species is None else list(species)
        self.rules = rules
        self.tray = Tray(rules.box, rules.periodic, rules.motion)
        self.wall_restitution = np.broadcast_to(rules.wall_restitution, 6)
        self.time = 0.0
        self.ledger = Ledger()
        self.last_touched = {}  # (bead, 'bead' or 'wall', partner): time

    positions = property(lambda self: self.beads.positions.copy())
    velocities = property(lambda self: self.beads.velocities.copy())
    spins = property(lambda self: self.beads.spins.copy())
    body = property(lambda self: self.beads.body.copy())
    fixed = property(lambda self: self.beads.fixed.copy())
    counts = property(lambda self: self.beads.counts.copy())

    def at(self, time):
        """Positions at a time, if nothing happens until then."""
        return self.positions + self.velocities * (time - self.time)

    def run_until(self, end):
        """Execute all events up to `end`, move there, and return the events."""
        events = []
        while (event := self.step(end)) is not None:
            events.append(event)
        self.beads.advance(end - self.time)
        self.time = end
        return events

    def step(self, end=math.inf):
        """Execute the next event; None, with nothing moved, when none comes up to `end`."""
        contact = next_contact(self.beads, self.tray, self.time, end)
        if contact is None:
            return None
        self.beads.advance(contact.delay)
        self.time = contact.time
        return self.meet_wall(contact) if contact.shift is None else self.meet_bead(contact)

    def touched_lately(self, i, kind, partner):
        """Whether these two touched less than the contact duration ago; notes that they do now."""
        last = self.last_touched.get((i, kind, partner), -math.inf)
        self.last_touched[i, kind, partner] = self.time
        return self.time - last < self.rules.contact_duration

    def meet_bead(self, contact):
        i, j = contact.i, contact.partner
        lately = self.touched_lately(i, 'bead', j)
        apart = self.positions[j] + contact.shift - self.positions[i]
        normal = apart / math.sqrt(apart @ apart)
        u = self.velocities[j] - self.velocities[i]
        before = self.beads.energy(i, j)
        if measure(self.rules, u, u @ normal) < self.rules.sticking_speed:
            kind, impulse = 'merge', self.merge(i, j, u)
            self.ledger.energy_lost_in_merges += before - self.beads.energy(i, j)
        else:
            kind, impulse = 'pair', self.bounce_pair(i, j, normal, u, lately)
            self.ledger.energy_lost_in_pairs += before - self.beads.energy(i, j)
        self.beads.count(i, j)
        return Event(self.time, kind, i, j, abs(u @ normal), math.sqrt(impulse @ impulse))

    def merge(self, i, j, u):
        """Join two bodies; the impulse on that of j."""
        impulse = -u / (self.beads.per_mass(i) + self.beads.per_mass(j))
        self.note_on_fixed(i, j, impulse)
        self.beads.join(i, j)
        return impulse

    def bounce_pair(self, i, j, normal, u, lately):
        """Collide two bodies; the impulse on that of j."""
        restitution, tangential = 1.0, -1.0
        if not lately:
            restitution = self.restitution_of(i, j, abs(u @ normal))
            tangential = or_smooth(self.rules.tangential_restitution)
        beads = self.beads
        per_masses = beads.per_mass(i), beads.per_mass(j)
        per_inertias = beads.per_inertia(i), beads.per_inertia(j)
        radii = beads.radii[i], beads.radii[j]
        slipping = slip(normal, u, radii[0] * self.spins[i] + radii[1] * self.spins[j])
        along = normal_impulse(normal, u, per_masses, restitution)
        limit = self.rules.friction * math.sqrt(along @ along)
        across = tangential_impulse(slipping, per_masses, radii, per_inertias, tangential, limit)
        self.note_on_fixed(i, j, along + across)
        beads.push(i, -(along + across))
        beads.push(j, along + across)
        beads.turn(i, normal, across)
        beads.turn(j, normal, across)
        return along + across

    def restitution_of(self, i, j, approach):
        kinds = self.species[i], self.species[j]
        counts = self.counts[i], self.counts[j]
        return pair_restitution(self.rules, kinds, (i, j), counts, approach)

    def note_on_fixed(self, i, j, impulse):
        """Note momentum that a fixed body gets, `impulse` being that on the body of j."""
        if self.fixed[i]:
            self.ledger.fixed_impulse -= impulse
        if self.fixed[j]:
            self.ledger.fixed_impulse += impulse

    def meet_wall(self, contact):
        i, wall = contact.i, contact.partner
        axis, inward = axis_of(wall), inward_of(wall)
        lately = self.touched_lately(i, 'wall', wall)
        place = self.tray.coordinate(wall, self.time) + inward * self.beads.radii[i]
        self.beads.put(i, axis, place)
        u = self.tray.velocity(self.time) - self.velocities[i]
        before = self.beads.energy(i)
        if measure(self.rules, u, u[axis]) < self.rules.wall_sticking_speed:
            kind, impulse = 'fix', self.beads.momentum(i)
            self.beads.fix(i)
        else:
            kind, impulse = 'wall', self.bounce_wall(i, wall, u, lately)
        self.ledger.energy_lost_at_walls += before - self.beads.energy(i)
        self.ledger.wall_impulse[wall] += impulse
        self.beads.count(i)
        return Event(self.time, kind, i, wall, abs(u[axis]), math.sqrt(impulse @ impulse))

    def bounce_wall(self, i, wall, u, lately):
        """Reflect a body at a wall; the impulse on the wall, a body of infinite mass."""
        restitution, tangential = 1.0, -1.0
        if not lately:
            restitution = self.wall_restitution[wall]
            tangential = or_smooth(self.rules.wall_tangential_restitution)
        axis, inward, beads = axis_of(wall), inward_of(wall), self.beads
        normal = np.zeros(3)
        normal[axis] = -inward
        approach = abs(u[axis])
        least = self.tray.least_rebound(wall, self.time, self.rules.contact_duration)
        rebound = max(restitution * approach, least)
        radii, per_inertias = (beads.radii[i],), (beads.per_inertia(i),)
        slipping = slip(normal, u, radii[0] * self.spins[i])
        along = beads.mass(i) * (approach + rebound) * normal
        limit = self.rules.wall_friction * math.sqrt(along @ along)
        across = tangential_impulse(
            slipping, (beads.per_mass(i),), radii, per_inertias, tangential, limit
        )
        wall_velocity = self.tray.velocity(self.time)[axis]
        beads.push(i, -across)
        beads.set_velocity(i, axis, wall_velocity + inward * rebound)
        beads.turn(i, normal, across)
        return along + across


def check(rules, spins):
    """Refuse what the rules exclude."""
    if rules.motion is not None and rules.wall_sticking_speed > 0.0:
        raise ValueError('walls: moving ones cannot hold beads; set wall_sticking_speed to 0')
    if rules.sticking_measure not in ('normal', 'total'):
        raise ValueError(f'sticking_measure {rules.sticking_measure!r}; use normal or total')
    if rules.tangential_restitution is None:
        if rules.wall_tangential_restitution is not None:
            raise ValueError('walls: rough while the beads are smooth; give both, or neither')
        if spins is not None and np.any(spins):
            raise ValueError('spins: smooth beads have none; give tangential_restitution')


def measure(rules, u, normal_speed):
    """The speed that decides on sticking."""
    return abs(normal_speed) if rules.sticking_measure == 'normal' else math.sqrt(u @ u)


def or_smooth(tangential):
    return -1.0 if tangential is None else tangential
