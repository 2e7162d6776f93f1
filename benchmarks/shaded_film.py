"""Films of shaded spheres in a box, pixel by pixel: a camera beside that of the package.

It shares nothing with `nanorocks_ros.simulation.plate_scene`: spheres are shaded by their
normals (Lambert and Blinn), cast soft shadows on a floor of felt, paper or wood, hide each other
and grow with their height; the walls are seen from inside; pictures are exposed for the time
between two of them, blurred, darker in the corners, noisy, and compressed as H.264.

Tested by ``test/validation/test_soft_spheres.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.soft_spheres import SoftBox, SoftRun
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.studies.synthetic.film_video import VideoQuality, images_into_video

EXPOSURES = 2
"""States of a run that one picture is made of."""

_SUBPIXEL_BITS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class LabCamera:
    """Camera, light, and the colours of what it sees.

    Parameters
    ----------
    size : tuple of 2 ints, [px]
        Columns and rows.
    scale : float, [px/m]
        On the floor.
    centre : tuple of 2 floats, [px]
        Where the centre of the floor is seen.
    distance : float, [m]
        From the floor.
    rate : float, [1/s]
    light : tuple of 3 floats
        Direction to it.
    ambient, shine, highlight, shadow : float
        Share of light from everywhere, exponent and strength of the highlight, depth of shadows.
    floor, rim, outside : tuple of 3 floats, bgr, [gray levels]
    beads : tuple of such, one for each species
    texture, grain : float, float [px]
        Relative contrast of the floor and its size.
    blur, noise, vignette : float, [px], [gray levels], -
    crf : float
        Constant rate factor of x264.
    seed : int
        Of floor and noise.
    """

    size: tuple[int, int]
    scale: float
    centre: tuple[float, float]
    distance: float = 0.35
    rate: float = 60.0
    light: tuple[float, float, float] = (0.4, -0.3, 0.85)
    ambient: float = 0.35
    shine: float = 30.0
    highlight: float = 0.5
    shadow: float = 0.4
    floor: tuple[float, float, float] = (180.0, 190.0, 190.0)
    rim: tuple[float, float, float] = (155.0, 150.0, 150.0)
    outside: tuple[float, float, float] = (64.0, 60.0, 60.0)
    beads: tuple[tuple[float, float, float], ...] = ((60.0, 60.0, 60.0),)
    texture: float = 0.04
    grain: float = 1.2
    blur: float = 0.9
    noise: float = 2.5
    vignette: float = 0.3
    crf: float = 21.0
    seed: int = 0


def write_shaded_film(
    path: Path, run: SoftRun, box: SoftBox, species: np.ndarray, camera: LabCamera
) -> None:
    """Write a film of a run with `EXPOSURES` states for each picture."""
    values = {
        'width_px': camera.size[0],
        'height_px': camera.size[1],
        'frame_rate': camera.rate,
    }
    settings = with_values(SimulationSettings(), values, 'benchmark')
    images_into_video(
        path,
        settings,
        shaded_pictures(run, box, species, camera),
        frames=len(run.positions) // EXPOSURES,
        progress=lambda *_: None,
        quality=VideoQuality(crf=camera.crf),
    )


def shaded_pictures(
    run: SoftRun, box: SoftBox, species: np.ndarray, camera: LabCamera
) -> Iterator[np.ndarray]:
    """Pictures of a run, uint8 (rows, columns, 3), bgr."""
    picture = Shading(box, species, camera)
    for first in range(0, len(run.positions) - EXPOSURES + 1, EXPOSURES):
        states = range(first, first + EXPOSURES)
        yield picture.exposed([(run.positions[k], run.displacement[k]) for k in states])


class Shading:
    """Draws the states of a run."""

    def __init__(self, box: SoftBox, species: np.ndarray, camera: LabCamera) -> None:
        self._box, self._species, self._camera = box, species, camera
        self._random = np.random.default_rng(camera.seed)
        columns, rows = camera.size
        self._rows, self._columns = np.mgrid[:rows, :columns].astype(np.float32)
        coarse = self._texture(40.0)
        fine = self._texture(camera.grain)
        self._floor = _painted(camera.floor, camera.texture * fine + 0.03 * coarse)
        self._outside = _painted(camera.outside, 0.1 * fine + 0.06 * coarse)
        aside = (self._columns / columns - 0.5) ** 2 + (self._rows / rows - 0.5) ** 2
        self._corners = (1.0 - 2.0 * camera.vignette * aside)[..., None]
        light = np.array(camera.light)
        self._light = light / np.linalg.norm(light)
        half_way = self._light + np.array([0.0, 0.0, 1.0])
        self._half_way = half_way / np.linalg.norm(half_way)

    def exposed(self, states: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """One picture of these places and displacements of the box."""
        camera = self._camera
        image = np.mean([self._drawn(*state) for state in states], axis=0)
        image = cv2.GaussianBlur(image, (0, 0), camera.blur) * self._corners
        grain = self._random.standard_normal(image.shape, dtype=np.float32)
        image += camera.noise * grain * np.sqrt(np.clip(image, 5.0, 255.0) / 128.0)
        return np.clip(image, 0.0, 255.0).astype(np.uint8)

    def _texture(self, size: float) -> np.ndarray:
        shape = self._camera.size[::-1]
        noise = self._random.standard_normal(shape, dtype=np.float32)
        smooth = cv2.GaussianBlur(noise, (0, 0), size)
        return smooth / smooth.std()

    def seen(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows of places (..., 3), [px], and the scale there (...), [px/m]."""
        camera = self._camera
        scales = camera.scale * camera.distance / (camera.distance - places[..., 2])
        aside = places[..., :2] - 0.5 * np.array(self._box.sides[:2])
        return camera.centre + scales[..., None] * aside, scales

    def _drawn(self, places: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        image = self._outside.copy()
        bottom, top = (
            self._corners_at(height, displacement) for height in (0.0, self._box.sides[2])
        )
        rim = np.array(self._camera.rim)
        wide = 4e-3 * self._camera.scale * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        _fill(image, top + wide, rim)
        for k, shade in enumerate((0.64, 0.68, 0.8, 0.72)):
            after = (k + 1) % 4
            _fill(image, np.stack([top[k], top[after], bottom[after], bottom[k]]), shade * rim)
        inside = np.zeros(image.shape[:2], np.float32)
        _fill(inside, bottom, 1.0)
        shift = np.float32([[1, 0, 0], [0, 1, 0]])
        shift[:, 2] = self._camera.scale * displacement
        size = self._camera.size
        floor = cv2.warpAffine(self._floor, shift, size, borderMode=cv2.BORDER_REFLECT)
        floor *= self._in_shadow(places)[..., None]
        image += inside[..., None] * (floor - image)
        for k in np.argsort(places[:, 2]):
            self._draw_sphere(image, places[k], self._box.radii[k], self._species[k])
        return image

    def _corners_at(self, height: float, displacement: np.ndarray) -> np.ndarray:
        """Corners of the box, (4, 2), [px]."""
        width, length, _ = self._box.sides
        corners = np.array([[0, 0], [width, 0], [width, length], [0, length]]) + displacement
        return self.seen(np.column_stack([corners, np.full(4, height)]))[0]

    def _around(self, centre: np.ndarray, reach: float) -> tuple[slice, slice] | None:
        """Rows and columns up to so far from a place; None outside the picture."""
        columns, rows = self._camera.size
        left, top = np.maximum(0, np.floor(centre - reach)).astype(int)
        right, bottom = np.minimum((columns, rows), np.ceil(centre + reach)).astype(int)
        return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None

    def _in_shadow(self, places: np.ndarray) -> np.ndarray:
        """Share of the light that the floor gets."""
        lit = np.ones(self._camera.size[::-1], np.float32)
        for place, radius in zip(places, self._box.radii, strict=True):
            slope = self._light[:2] / self._light[2]
            foot = np.array([*(place[:2] - slope * place[2]), 0.0])
            centre, scale = self.seen(foot)
            soft = 1.0 + 0.15 * place[2] * scale
            part = self._around(centre, radius * scale + 6.0 * soft)
            if part:
                away = np.hypot(self._columns[part] - centre[0], self._rows[part] - centre[1])
                edge = np.clip((away - radius * scale) / soft, -30.0, 30.0)
                lit[part] *= 1.0 - self._camera.shadow / (1.0 + np.exp(edge))
        return lit

    def _draw_sphere(
        self, image: np.ndarray, place: np.ndarray, radius: float, species: int
    ) -> None:
        camera = self._camera
        centre, scale = self.seen(place)
        size = radius * scale
        part = self._around(centre, size + 1.0)
        if part is None:
            return
        across = (self._columns[part] - centre[0]) / size
        down = (self._rows[part] - centre[1]) / size
        square = across * across + down * down
        up = np.sqrt(np.clip(1.0 - square, 0.0, 1.0))
        cover = np.clip((1.0 - np.sqrt(square)) * size + 0.5, 0.0, 1.0)[..., None]
        lit, mirrored = (
            np.clip(across * way[0] + down * way[1] + up * way[2], 0.0, 1.0)
            for way in (self._light, self._half_way)
        )
        bright = camera.ambient * (0.7 + 0.3 * up) + (1.0 - camera.ambient) * lit
        colour = np.array(camera.beads[species]) * bright[..., None]
        colour += 255.0 * camera.highlight * (mirrored**camera.shine)[..., None]
        image[part] += cover * (colour - image[part])


def _painted(colour: tuple[float, float, float], contrast: np.ndarray) -> np.ndarray:
    """A colour with a texture, (rows, columns, 3)."""
    return np.float32(colour) * (1.0 + contrast[..., None])


def _fill(image: np.ndarray, corners: np.ndarray, colour: np.ndarray | float) -> None:
    points = np.round(corners * 2**_SUBPIXEL_BITS).astype(np.int32)
    shade = np.broadcast_to(colour, 3).tolist()
    cv2.fillPoly(image, [points], shade, cv2.LINE_AA, _SUBPIXEL_BITS)


def beads_seen_px(box: SoftBox, camera: LabCamera) -> list[float]:
    """Diameters as a user reads them off a picture, half way up the box, one for each radius."""
    scale = camera.scale * camera.distance / (camera.distance - 0.5 * box.sides[2])
    return [2.0 * scale * radius for radius in sorted(set(box.radii), reverse=True)]


def floor_px(box: SoftBox, camera: LabCamera) -> list[int]:
    """Left, top, right and bottom of the floor, in whole pixels."""
    half = 0.5 * camera.scale * np.array(box.sides[:2])
    centre = np.array(camera.centre)
    return [round(float(value)) for value in (*(centre - half), *(centre + half))]
