"""Discs in a flat box, event by event: an engine of a few lines beside that of the package.

Its contacts, paths and pictures share nothing with `nanorocks_ros.simulation`. Discs may fall, be
kicked again and again, or be a single one; of one that falls and rests the bounces get ever
shorter, and it rolls on at last.

Tested by ``test/validation/test_flat_discs.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

# Fall speed below which a disc does not bounce any more, [m/s].
_REST = 1e-3
_SUBPIXEL = 16.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatBox:
    """What is in the box, and how it moves.

    Parameters
    ----------
    count : int
    sides : tuple of 2 floats, [m]
    radius : float, [m]
    restitution, wall_restitution : float
    gravity : tuple of 2 floats, [m/s^2]
        Along columns and rows.
    speed : float, [m/s]
        Standard deviation of a component of the first velocities, and of those of a kick.
    kicks : float, [s]
        Time from kick to kick; 0: none.
    """

    count: int = 12
    sides: tuple[float, float] = (0.06, 0.045)
    radius: float = 1.5e-3
    restitution: float = 0.85
    wall_restitution: float = 0.93
    gravity: tuple[float, float] = (0.0, 0.0)
    speed: float = 0.04
    kicks: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatRun:
    """Places and velocities in each frame, (frames, count, 2), and the contacts.

    `collisions` has a row for each: time and normal speed; `rebounds` the same with the wall.
    """

    places: np.ndarray
    velocities: np.ndarray
    collisions: np.ndarray
    rebounds: np.ndarray


class _Discs:
    """The state of the discs, and the next contact."""

    def __init__(self, box: FlatBox, random: np.random.Generator) -> None:
        self.box = box
        self.sides = np.array(box.sides)
        self.gravity = np.array(box.gravity)
        self.places = self._apart(random)
        self.velocities = box.speed * random.standard_normal((box.count, 2))
        # Discs that roll on a wall do not fall.
        self.rolls = np.zeros((box.count, 2), dtype=bool)
        self.pairs = np.triu_indices(box.count, 1)

    def _apart(self, random: np.random.Generator) -> np.ndarray:
        places: list[np.ndarray] = []
        while len(places) < self.box.count:
            radius = self.box.radius
            place = 1.05 * radius + random.random(2) * (self.sides - 2.1 * radius)
            if all(math.dist(place, other) > 2.1 * radius for other in places):
                places.append(place)
        return np.array(places)

    @property
    def accelerations(self) -> np.ndarray:
        """Of each disc: that of gravity, unless it rolls."""
        return np.where(self.rolls, 0.0, self.gravity)

    def move(self, duration: float) -> None:
        """Free flight."""
        fall = self.accelerations * duration
        self.places += (self.velocities + 0.5 * fall) * duration
        self.velocities += fall

    def next_pair(self) -> tuple[float, int]:
        """Time until the next two discs meet, and the number of the pair."""
        first, second = self.pairs
        if not first.size:
            return math.inf, 0
        # All fall alike; of a pair in which one rolls the bend is left out until they are near.
        apart = self.places[first] - self.places[second]
        speed = self.velocities[first] - self.velocities[second]
        approach = np.einsum('ij,ij->i', apart, speed)
        size = np.einsum('ij,ij->i', speed, speed)
        gap = np.einsum('ij,ij->i', apart, apart) - 4.0 * self.box.radius**2
        root = approach**2 - size * gap
        meets = (approach < 0.0) & (root > 0.0)
        times = np.full(first.size, math.inf)
        times[meets] = (-approach[meets] - np.sqrt(root[meets])) / size[meets]
        times = np.maximum(times, 0.0)
        k = int(np.argmin(times))
        return float(times[k]), k

    def next_wall(self) -> tuple[float, int, int]:
        """Time until the next disc meets a wall, its number and that of the wall."""
        best = (math.inf, 0, 0)
        for wall in range(4):
            axis, high = divmod(wall, 2)
            outward = 1.0 if high else -1.0
            edge = self.sides[axis] - self.places[:, axis] if high else self.places[:, axis]
            times = _hits(
                edge - self.box.radius,
                outward * self.velocities[:, axis],
                outward * self.accelerations[:, axis],
            )
            times[self.rolls[:, axis]] = math.inf
            k = int(np.argmin(times))
            best = min(best, (float(times[k]), k, wall))
        return best

    def collide(self, pair: int) -> float:
        """Two discs of one mass; gives their normal speed."""
        first, second = self.pairs[0][pair], self.pairs[1][pair]
        normal = self.places[first] - self.places[second]
        normal /= math.hypot(*normal)
        speed = float((self.velocities[first] - self.velocities[second]) @ normal)
        push = -0.5 * (1.0 + self.box.restitution) * speed * normal
        self.velocities[first] += push
        self.velocities[second] -= push
        return -speed

    def rebound(self, disc: int, wall: int) -> float:
        """A disc from a wall; gives its normal speed."""
        axis, high = divmod(wall, 2)
        outward = 1.0 if high else -1.0
        speed = outward * self.velocities[disc, axis]
        self.velocities[disc, axis] *= -self.box.wall_restitution
        if speed < _REST and outward * self.gravity[axis] > 0.0:
            self.velocities[disc, axis], self.rolls[disc, axis] = 0.0, True
        return float(speed)


def _hits(gaps: np.ndarray, speeds: np.ndarray, accelerations: np.ndarray) -> np.ndarray:
    """Times until gaps are closed, by speeds and accelerations towards them."""
    gaps = np.maximum(gaps, 0.0)
    root = speeds**2 + 2.0 * accelerations * gaps
    size = np.sqrt(np.maximum(root, 0.0))
    times = np.full(gaps.shape, math.inf)
    # Neither form has a difference of numbers that are nearly equal.
    near = (root > 0.0) & (speeds > 0.0)
    times[near] = 2.0 * gaps[near] / (speeds + size)[near]
    falls = (speeds <= 0.0) & (accelerations > 0.0)
    times[falls] = (size - speeds)[falls] / accelerations[falls]
    return times


def flat_run(box: FlatBox, seconds: float, *, rate: float = 60.0, seed: int = 0) -> FlatRun:
    """Follow the discs, with frames at a rate."""
    random = np.random.default_rng(seed)
    discs = _Discs(box, random)
    time, next_kick = 0.0, box.kicks or math.inf
    frames, collisions, rebounds = [], [], []
    for moment in np.arange(round(seconds * rate)) / rate:
        while time < moment:
            (until_pair, pair), (until_wall, disc, wall) = discs.next_pair(), discs.next_wall()
            step = min(until_pair, until_wall, moment - time, next_kick - time)
            discs.move(step)
            time += step
            if step == until_wall:
                rebounds.append((time, discs.rebound(disc, wall), wall))
            elif step == until_pair:
                collisions.append((time, discs.collide(pair)))
            elif time >= next_kick:
                discs.velocities += box.speed * random.standard_normal(discs.velocities.shape)
                discs.rolls[:] = False
                next_kick += box.kicks
            else:
                break
        time = float(moment)
        frames.append((discs.places.copy(), discs.velocities.copy()))
    places, velocities = (np.array(rows) for rows in zip(*frames, strict=True))
    return FlatRun(
        places=places,
        velocities=velocities,
        collisions=np.array(collisions).reshape(-1, 2),
        rebounds=np.array(rebounds).reshape(-1, 3),
    )


def flat_pictures(run: FlatRun, box: FlatBox, pixels_per_metre: float, *, seed: int = 0):
    """Dark discs on a gray floor, blurred, with noise: a picture (rows, columns, 3) per frame."""
    random = np.random.default_rng(seed)
    columns, rows = (round(side * pixels_per_metre) for side in box.sides)
    radius = round(_SUBPIXEL * box.radius * pixels_per_metre)
    for places in run.places:
        picture = np.full((rows, columns, 3), 150, dtype=np.uint8)
        for x, y in _SUBPIXEL * (places * pixels_per_metre - 0.5):
            cv2.circle(picture, (round(x), round(y)), radius, (45, 45, 45), -1, cv2.LINE_AA, 4)
        blurred = cv2.GaussianBlur(picture, (0, 0), 0.7).astype(float)
        noisy = blurred + random.normal(0.0, 1.5, picture.shape)
        yield np.clip(noisy, 0, 255).astype(np.uint8)
