"""Drawn films of beads of any look on any floor, with their places; no code of the package.

Discs fly straight, bounce off the edges of the picture and off each other, and are painted one by
one: shaded balls with highlight and cast shadow, or clear ones of which only the rim shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

# Places that are tried for a bead before the picture counts as full.
_TRIES = 20_000


@dataclass(frozen=True, kw_only=True)
class DrawnScene:
    """A film to draw; colours are bgr, lengths in pixels, speeds in pixels per frame.

    `texture` is the amplitude of stains on the floor, `light` the fall of the light across the
    picture, `shadow` the darkness of cast shadows, `rim` the opacity of the rim of clear beads
    (0: solid ones), `clutter` adds a rail, a stain and three holes that never move. With `sizes`
    beads have these radii in turn, and not any of `radii`; the colours follow them.
    """

    floor: tuple[float, float, float] = (150, 150, 150)
    colours: tuple[tuple[float, float, float], ...] = ((60, 60, 60),)
    radii: tuple[float, float] = (9.0, 9.0)
    sizes: tuple[float, ...] = ()
    count: int = 25
    size: tuple[int, int] = (400, 300)
    speed: float = 2.0
    frames: int = 60
    texture: float = 0.0
    light: float = 0.15
    shadow: float = 0.0
    highlight: float = 80.0
    rim: float = 0.0
    noise: float = 3.0
    blur: float = 0.8
    clutter: bool = False
    at_rest: float = 0.0
    seed: int = 1


def draw(scene):
    """Frames, uint8 (rows, columns, 3), and places (beads, 3) of each: column, row, radius.

    The centre of the first pixel is at (0, 0).
    """
    rng = np.random.default_rng(scene.seed)
    floor = _floor(scene, rng)
    places, velocities, radii = _start(scene, rng)
    kinds = rng.integers(0, len(scene.colours), scene.count)
    if scene.sizes:
        kinds = np.arange(scene.count) % len(scene.sizes) % len(scene.colours)
    frames, truth = [], []
    for _ in range(scene.frames):
        frame = floor.copy()
        for place, radius in zip(places, radii, strict=True):
            _paint_shadow(frame, place, radius, scene)
        for place, radius, kind in zip(places, radii, kinds, strict=True):
            _paint_bead(frame, place, radius, scene.colours[kind], scene)
        frame = cv2.GaussianBlur(frame, (0, 0), scene.blur)
        frame += rng.normal(0.0, scene.noise, frame.shape)
        frames.append(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
        truth.append(np.column_stack([places, radii]))
        _move(places, velocities, radii, scene)
    return frames, truth


def _floor(scene, rng):
    columns, rows = scene.size
    y, x = np.mgrid[:rows, :columns]
    fall = 1.0 - scene.light * (x / columns + y / rows - 1.0)
    floor = np.array(scene.floor) * fall[..., None]
    if scene.texture:
        stains = cv2.GaussianBlur(rng.normal(0.0, 1.0, (rows, columns)), (0, 0), 5.0)
        floor += scene.texture * (stains / stains.std())[..., None]
    if scene.clutter:
        base = np.array(scene.floor)
        cv2.rectangle(floor, (0, rows // 2 - 8), (columns, rows // 2 - 4), tuple(0.6 * base), -1)
        for k in range(3):
            place = (columns * (2 * k + 1) // 6, rows // 7)
            cv2.circle(floor, place, round(1.5 * scene.radii[1]), tuple(0.15 * base), -1)
    return floor


def _start(scene, rng):
    columns, rows = scene.size
    radii = rng.uniform(*scene.radii, scene.count)
    if scene.sizes:
        radii = np.resize(scene.sizes, scene.count).astype(float)
    if scene.count and 2.0 * (radii.max() + 1.0) >= min(columns, rows):
        raise _do_not_fit(scene, 0)
    places = np.empty((0, 2))
    tries = 0
    while len(places) < scene.count:
        radius = radii[len(places)]
        tries += 1
        if tries > _TRIES:
            raise _do_not_fit(scene, len(places))
        place = rng.uniform(radius + 1, [columns - radius - 1, rows - radius - 1])
        apart = np.hypot(*(places - place).T)
        if (apart > radii[: len(places)] + radius + 1.0).all():
            places = np.vstack([places, place])
            tries = 0
    turns = rng.uniform(0.0, 2.0 * math.pi, scene.count)
    speeds = scene.speed * rng.rayleigh(0.8, scene.count)
    speeds[rng.random(scene.count) < scene.at_rest] = 0.0
    return places, speeds[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1), radii


def _do_not_fit(scene, count):
    return SystemExit(
        f'drawn scene: {count} of {scene.count} beads fit in {scene.size[0]} x {scene.size[1]} '
        'px; draw fewer or smaller ones, or a larger picture'
    )


def _move(places, velocities, radii, scene):
    steps = 8
    for _ in range(steps):
        places += velocities / steps
        for axis, length in enumerate(scene.size):
            low, high = places[:, axis] < radii, places[:, axis] > length - 1 - radii
            velocities[low, axis] = np.abs(velocities[low, axis])
            velocities[high, axis] = -np.abs(velocities[high, axis])
        between = places[:, None] - places[None]
        apart = np.hypot(between[..., 0], between[..., 1])
        touching = np.triu(apart < radii[:, None] + radii[None], 1)
        for i, j in np.argwhere(touching):
            normal = between[i, j] / apart[i, j]
            closing = (velocities[i] - velocities[j]) @ normal
            if closing < 0.0:
                velocities[i] -= closing * normal
                velocities[j] += closing * normal


def _patch(frame, place, reach):
    rows, columns = frame.shape[:2]
    left, top = (max(0, math.floor(value - reach)) for value in place)
    right = min(columns, math.ceil(place[0] + reach) + 1)
    bottom = min(rows, math.ceil(place[1] + reach) + 1)
    y, x = np.mgrid[top:bottom, left:right]
    return frame[top:bottom, left:right], x - place[0], y - place[1]


def _paint_shadow(frame, place, radius, scene):
    if not scene.shadow:
        return
    shifted = place + 0.55 * radius
    patch, x, y = _patch(frame, shifted, 1.8 * radius)
    cover = np.clip((1.3 * radius - np.hypot(x, y)) / (0.7 * radius), 0.0, 1.0)
    patch *= 1.0 - scene.shadow * cover[..., None]


def _paint_bead(frame, place, radius, colour, scene):
    patch, x, y = _patch(frame, place, radius + 2.0)
    away = np.hypot(x, y)
    cover = np.clip(radius - away + 0.5, 0.0, 1.0)
    inside = np.clip(away / radius, 0.0, 1.0)
    lamp = np.clip((-x - y) / (math.sqrt(2.0) * radius), -1.0, 1.0)
    value = np.array(colour) * (1.0 - 0.25 * inside**2 + 0.15 * lamp)[..., None]
    if scene.rim:
        opacity = scene.rim * np.clip((inside - 0.6) / 0.3, 0.12, 1.0)
    else:
        opacity = np.ones_like(away)
    shine = np.exp(-((x + 0.35 * radius) ** 2 + (y + 0.35 * radius) ** 2) / (0.18 * radius) ** 2)
    painted = patch + (value - patch) * opacity[..., None] + scene.highlight * shine[..., None]
    patch += (painted - patch) * cover[..., None]


SCENES = {
    'dark on gray': DrawnScene(),
    'bright on dark': DrawnScene(floor=(30, 28, 25), colours=((200, 205, 210),)),
    'white on light gray': DrawnScene(
        floor=(165, 165, 165), colours=((240, 240, 240),), highlight=10, shadow=0.3
    ),
    'black on black': DrawnScene(
        floor=(40, 40, 40), colours=((15, 15, 15),), highlight=120, noise=1.5
    ),
    'same lightness, other colour': DrawnScene(
        floor=(90, 160, 60), colours=((60, 105, 190),), highlight=60
    ),
    'four colours': DrawnScene(
        floor=(120, 120, 120),
        colours=((40, 40, 200), (200, 80, 40), (50, 170, 60), (30, 190, 210)),
        shadow=0.2,
    ),
    'clear': DrawnScene(floor=(140, 145, 140), colours=((70, 75, 75),), rim=0.6, highlight=90),
    'clear, stained floor': DrawnScene(
        floor=(140, 145, 140), colours=((70, 75, 75),), rim=0.6, highlight=90, texture=12
    ),
    'clear, shadows': DrawnScene(
        floor=(140, 145, 140), colours=((70, 75, 75),), rim=0.6, highlight=90, shadow=0.3
    ),
    'clear, green floor, rail, holes': DrawnScene(
        floor=(60, 120, 50), colours=((30, 60, 25),), rim=0.6, highlight=90, clutter=True
    ),
    'dark shadows': DrawnScene(floor=(170, 170, 165), colours=((70, 70, 120),), shadow=0.5),
    'stained floor, rail, holes': DrawnScene(
        floor=(100, 140, 170), colours=((60, 60, 60),), texture=12, clutter=True
    ),
    'radii 6 to 14 px': DrawnScene(
        radii=(6, 14), floor=(40, 120, 30), colours=((210, 210, 215),), shadow=0.4
    ),
    'radius 3 px': DrawnScene(radii=(3, 3), count=60, speed=1),
    'radius 28 px, four': DrawnScene(
        radii=(28, 28),
        count=4,
        floor=(60, 110, 60),
        colours=((200, 200, 210), (30, 30, 170)),
        shadow=0.4,
    ),
    'crowded': DrawnScene(count=140, speed=1.0, floor=(170, 180, 180), colours=((70, 100, 140),)),
    'half of them at rest': DrawnScene(
        at_rest=0.5, clutter=True, floor=(60, 120, 50), colours=((210, 210, 215),)
    ),
    'a single one': DrawnScene(
        count=1, speed=4, floor=(60, 120, 50), colours=((40, 40, 190),), clutter=True, shadow=0.3
    ),
}
"""Scenes by what is difficult in them."""
