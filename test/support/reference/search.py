"""Search for the next contact among all pairs and all walls."""

from __future__ import annotations

import itertools
import math

from .contacts import Contact, next_of_pair, resting_wall_delay
from .tray import Approach, axis_of, inward_of

LONGEST_SEARCH = 10_000  # windows, when the end is not given


def next_contact(beads, tray, now, end):
    """The first contact after `now`, None if it comes after `end`.

    Without an end, also None if there is none in all the windows that are searched.
    """
    for window in windows(beads, tray, now, end):
        contact = min(
            contacts(beads, tray, now, window), key=lambda option: option.order, default=None
        )
        if contact is not None and contact.time <= now + window[1]:
            return contact if contact.time <= end else None
    return None


def windows(beads, tray, now, end):
    """Delays (first, last) from now to the end, each so short that little can happen in it."""
    first, searched = 0.0, 0
    while now + first <= end and first < math.inf:
        if math.isinf(end) and searched == LONGEST_SEARCH:
            return
        last = first + window_width(beads, tray, now + first)
        yield first, last
        first, searched = last, searched + 1


def window_width(beads, tray, time):
    """No bead moves by more than a quarter of a periodic side, the tray by more than one period.

    Infinite when no axis is periodic and no wall moves any more.
    """
    fastest = math.sqrt((beads.velocities**2).sum(axis=1).max(initial=0.0))
    widths = [math.inf]
    if fastest > 0.0:
        widths += [side / 4.0 / fastest for side in tray.periods if side is not None]
    motion = tray.motion
    if motion is not None and time <= motion.end:
        still = max(motion.start - time, 0.0)
        widths.append(still + 2.0 * math.pi / motion.angular_frequency)
    return min(widths)


def contacts(beads, tray, now, window):
    """The next contact of every pair and of every bead with every wall."""
    for i, j in itertools.combinations(range(len(beads.radii)), 2):
        if beads.body[i] != beads.body[j]:
            delay, shift = next_of_pair(beads, i, j, window, tray.periods)
            if delay < math.inf:
                yield Contact(now + delay, delay, i, j, shift)
    for i, wall in itertools.product(range(len(beads.radii)), tray.walls):
        time, delay = next_at_wall(beads, i, tray, wall, (now, window))
        if delay < math.inf:
            yield Contact(time, delay, i, wall)


def next_at_wall(beads, i, tray, wall, when):
    """(time, delay) of the first contact of a bead and a wall, `when` being (now, window)."""
    axis, inward, radius = axis_of(wall), inward_of(wall), beads.radii[i]
    place, speed = beads.positions[i, axis], beads.velocities[i, axis]
    now, (first, last) = when
    if tray.motion is None:
        clearance = inward * (place - tray.coordinate(wall, now)) - radius
        delay = resting_wall_delay(clearance, -inward * speed)
        return now + delay, delay
    flight = Approach(tray, wall, (place, speed, radius), now)
    time = flight.meeting(now + first, now + last)
    return time, time - now
