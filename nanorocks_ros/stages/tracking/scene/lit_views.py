"""The outlines that beads lit from one side show in a picture, ray by ray.

Tested by ``test/stages/tracking/scene/test_lit_views.py``.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

from nanorocks_ros.stages.tracking.scene.outlines.disc_measures import join_outlines
from nanorocks_ros.stages.tracking.scene.outlines.lit_spheres import alone, lit_sphere
from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import fit_outlines
from nanorocks_ros.stages.tracking.scene.outlines.outline_kernels import RAYS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.stages.tracking.scene.bead_looks import View
    from nanorocks_ros.stages.tracking.scene.outlines.lit_spheres import LitSphere
    from nanorocks_ros.stages.tracking.scene.outlines.outline_fits import Outlines

# Where the outline may show on a ray, in radii, and the samples on two pixels of it.
_OUTLINE, _SAMPLES = (0.7, 1.3), 8
# Share of the outline of a disc that tells what its circle is off by, and turns to make it right.
_GOOD_SUPPORT, _TURNS = 0.7, 5
# Discs have two sizes where so many at least have each, and these differ by so much, as a
# logarithm, and by so many standard deviations.
_LEAST_BEADS, _OTHER_SIZE, _APART = 8, 0.1, 4.0


class LitSizes(NamedTuple):
    """How light shows beads of each size.

    Parameters
    ----------
    limits : tuple of floats, [px]
        Largest radius of the discs of each size.
    spheres : tuple of LitSphere or None
        Of each size; None: not known.
    """

    limits: tuple[float, ...]
    spheres: tuple[LitSphere | None, ...]

    @classmethod
    def of(
        cls, frames: Sequence[NDArray[np.uint8]], discs: Sequence[NDArray[np.float64]]
    ) -> LitSizes:
        """Those of frames (rows, columns, 3) with these discs (n, 3), [px]."""
        radii = np.sort(np.concatenate([rows[:, 2] for rows in discs]))
        limits = [*_between(radii), math.inf]
        ranges = list(pairwise([0.0, *limits]))
        spheres = [lit_sphere(frames, discs, sizes) for sizes in ranges]
        seen = [sphere for sphere in spheres if sphere is not None]
        if len(seen) > 1:
            # All are in one light, which the beads that are explained best tell.
            best = min(seen, key=lambda sphere: sphere.off)
            spheres = [
                sphere if sphere is best else lit_sphere(frames, discs, sizes, best)
                for sphere, sizes in zip(spheres, ranges, strict=True)
            ]
        return cls(tuple(limits), tuple(spheres))

    @property
    def shifts(self) -> bool:
        """Whether light shifts the discs of any size."""
        return any(sphere is not None and sphere.shifts for sphere in self.spheres)

    def beads(self, discs: NDArray[np.float64]) -> NDArray[np.float64]:
        """The beads that show as discs, (n, 3), [px]."""
        beads = discs.copy()
        shifted = [sphere for sphere in self.spheres if sphere is not None and sphere.shifts]
        for k, sphere in enumerate(self.spheres):
            # Of a size that is not known the light is that of another.
            its = sphere if sphere is not None else shifted[0]
            if its.shifts:
                own = np.searchsorted(self.limits, discs[:, 2], side='right') == k
                beads[own] = its.of(discs[own])
        return beads


def _between(radii: NDArray[np.float64]) -> list[float]:
    """Radius between two sizes, if discs have two; radii are sorted, [px]."""
    gaps = np.diff(np.log(radii))
    inner = gaps[_LEAST_BEADS - 1 : len(gaps) - _LEAST_BEADS + 1]
    if inner.size == 0:
        return []
    k = int(inner.argmax()) + _LEAST_BEADS
    small, large = radii[:k], radii[k:]
    apart = math.log(float(np.median(large)) / float(np.median(small)))
    spread = max(float(np.log(part).std()) for part in (small, large))
    if apart < max(_OTHER_SIZE, _APART * spread):
        return []
    return [math.sqrt(float(small[-1]) * float(large[0]))]


def in_light(
    view: View,
    pictures: Sequence[NDArray[np.uint8]],
    beads: Sequence[NDArray[np.float64]],
    limits: Sequence[float],
) -> View:
    """A view with the outlines by which circles are fitted to beads where these are.

    Parameters
    ----------
    view : View
    pictures : sequence of ndarrays of uint8, (rows, columns)
        Of this view.
    beads : sequence of ndarrays (n, 3), [px]
        In each picture: column, row, radius.
    limits : sequence of floats, [px]
        Largest radius of the beads of each size.
    """
    outline = np.array(_shown_outline(pictures, beads, view.voting.sign))
    known = np.concatenate(beads)
    off, good = np.zeros_like(known), np.zeros(len(known), dtype=bool)
    for turn in range(_TURNS):
        if turn:
            # Circles that lie on one side need an outline that does.
            outline = outline + outline_of(*np.median(off[good], axis=0).tolist())
        view = view._replace(voting=view.voting._replace(outline=tuple(outline.tolist())))
        fits = [fit_outlines(*pair, view.voting) for pair in zip(pictures, beads, strict=True)]
        outlines = join_outlines(fits)
        good = outlines.support >= _GOOD_SUPPORT
        off = (outlines.discs - known) / known[:, 2:]
        if not good.any():
            return view
    if len(limits) == 1:
        return view
    shifts = []
    for k, limit in enumerate(limits):
        own = good & (np.searchsorted(limits, known[:, 2], side='right') == k)
        shift = np.median(off[own], axis=0) if own.any() else np.zeros(3)
        shifts.append((limit, *(-shift).tolist()))
    return view._replace(shifts=tuple(shifts))


def shifted(outlines: Outlines, view: View) -> Outlines:
    """Circles of a view where the beads of their size are."""
    if not view.shifts:
        return outlines
    limits, shifts = np.array([row[0] for row in view.shifts]), np.array(view.shifts)[:, 1:]
    size = np.searchsorted(limits[:-1], outlines.discs[:, 2], side='right')
    return outlines._replace(discs=outlines.discs + outlines.discs[:, 2:] * shifts[size])


def _shown_outline(
    pictures: Sequence[NDArray[np.uint8]],
    beads: Sequence[NDArray[np.float64]],
    sign: int,
) -> tuple[float, ...]:
    """Where the mean of all beads is steepest on each ray, in radii, (RAYS,).

    Parameters
    ----------
    pictures : sequence of ndarrays of uint8, (rows, columns)
    beads : sequence of ndarrays (n, 3), [px]
        In each of them: column, row, radius.
    sign : int
        1: beads are brighter than what is around them, -1: darker, 0: either.
    """
    radius = float(np.median(np.concatenate(beads)[:, 2]))
    pitch = 2.0 / (_SAMPLES * radius)
    parts = np.arange(_OUTLINE[0] - 1.0 / radius, _OUTLINE[1] + 1.0 / radius, pitch)
    angles = 2.0 * math.pi * np.arange(RAYS) / RAYS
    across, down = np.outer(np.cos(angles), parts), np.outer(np.sin(angles), parts)
    total = np.zeros((RAYS, len(parts)))
    for picture, discs in zip(pictures, beads, strict=True):
        for column, row, size in alone(discs, picture.shape):
            x, y = column + size * across, row + size * down
            total += cv2.remap(
                picture, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR
            )
    # A step over two pixels, as on the rays of a bead.
    rises = total[:, :-_SAMPLES] - total[:, _SAMPLES:]
    rises = np.abs(rises) if sign == 0 else sign * rises
    places = parts[_SAMPLES // 2 : -_SAMPLES // 2]
    rated = rises * (1.0 - 0.5 * np.abs(places - 1.0) / (_OUTLINE[1] - 1.0))
    return tuple(places[rated.argmax(axis=1)].tolist())


def outline_of(across: float, down: float, radius: float) -> NDArray[np.float64]:
    """Change of an outline that shifts circles by so much, and their radius, in radii, (RAYS,)."""
    angles = 2.0 * math.pi * np.arange(RAYS) / RAYS
    return np.asarray(across * np.cos(angles) + down * np.sin(angles) + radius)
