"""Mean profiles across the outlines of the beads of a species, and the edges they imply.

An edge on a single ray is where a step between two levels near it would be. Two things move it off
the outline, alike for all beads of a species. The shadow beside a bead is deepest at the outline
and moves the edge outward, and blur of a curved outline moves it inward. The mean profile of many
beads has little noise, so that a model of a blurred step in a shadow fits it; its edge and blur
correct the edges of the rays, for each direction.

Tested by ``test/stages/tracking/detection/test_outline_profiles.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.stages.tracking.detection.bead_edges import (
    COSINES,
    CURVATURES,
    RAYS,
    SINES,
    edges_between,
)
from nanorocks_ros.stages.tracking.detection.blurred_discs import REACHES, edge_biases

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Samples from this far inside the outline to this far outside, [px]: blur ends before, and light
# and shadow are nearly linear over no more.
_INNER, _OUTER = 4, 5
_PLACES = np.arange(-_INNER, _OUTER + 1.0)
# Smallest radius of a bead that is averaged: blur leaves a plateau inside, [px].
_MIN_RADIUS_PX = 5.0
# Distance from other beads to the outermost sample, [px].
_CLEARANCE_PX = 2.0
# Visible share of the outline of a bead that is averaged.
_MIN_VISIBLE_OUTLINE = 0.5
# Profiles in a mean from which it is used, and the largest number, beyond which old ones fade.
_MIN_PROFILES, _MAX_PROFILES = 12.0, 1000.0
# One frame in so many is averaged, and the model fitted in one in so many, after the first ones.
_UPDATE_FRAMES, _FIT_FRAMES, _FIRST_FRAMES = 4, 32, 8
# Gauss-Newton steps of the model; it starts at the last result.
_STEPS = 6
# Limits of the width of the blur and of the distance of an edge from the circle, [px].
_MIN_WIDTH, _MAX_WIDTH, _MAX_EDGE = 0.3, 2.5, 2.0
# Quantile of the widths over the directions that is the width of the blur.
_SHARP_QUANTILE = 0.25
# Smallest step of a mean profile in levels, and largest correction, [px].
_MIN_STEP, _MAX_SHIFT_PX = 60.0, 0.6
# Levels over which the slope of the shadow is free, as a prior: those of a deep shadow per pixel.
_SLOPE_SPREAD = 15.0
# Scatter of a mean profile about the model, in levels.
_SCATTER = 1.5
# Relative change of the variance from which the biases are computed again.
_VARIANCE_STEP = 0.02
_START = np.array([0.0, 1.0, 225.0, 30.0, 0.0])


class OutlineProfiles:
    """Mean profiles of a species in each direction of the rays, and the corrections from them.

    Attributes
    ----------
    shifts : ndarray (2, RAYS), [px]
        Distance of an edge that is found within 2 and 3 px from the outline; see `PixelMaps`.
    variance : float, [px^2]
        Of the blur; 0 when it is not known.
    biases : ndarray (2, CURVATURES), [px]
        See `edge_biases`.
    """

    def __init__(self) -> None:
        self.shifts = np.zeros((len(REACHES), RAYS))
        self.variance = 0.0
        self.biases = np.zeros((2, CURVATURES))
        self._means = np.zeros((RAYS, _PLACES.size))
        self._counts = np.zeros(RAYS)
        self._models = np.tile(_START, (RAYS, 1))
        self._frame = 0

    def update(
        self,
        levels: NDArray[np.uint8],
        discs: NDArray[np.float64],
        first: int,
        visible_outline: NDArray[np.float64],
    ) -> None:
        """Add the profiles of the beads of a frame, in some frames.

        Parameters
        ----------
        levels : ndarray of uint8, (rows, columns)
            Map in which the edges are searched.
        discs : ndarray (n, 3), [px]
            Discs of all species.
        first : int
            Row of the first disc of this species.
        visible_outline : ndarray (m,)
            Of the discs from there on.
        """
        frame, is_first = self._frame, self._frame < _FIRST_FRAMES
        self._frame += 1
        if is_first or frame % _UPDATE_FRAMES == 0:
            add_profiles(levels, discs, first, visible_outline, self._means, self._counts)
        if is_first or frame % _FIT_FRAMES == 0:
            self._correct()

    def _correct(self) -> None:
        is_known = self._counts >= _MIN_PROFILES
        if np.count_nonzero(is_known) < RAYS // 2:
            return
        # A highlight inside the outline is no floor.
        profiles = np.maximum.accumulate(self._means[:, ::-1], axis=1)[:, ::-1]
        self._models = fit_steps(profiles, self._models)
        usable = is_known & _is_step(self._models)
        if np.count_nonzero(usable) < RAYS // 2:
            return
        # The blur is the same in all directions, and a shadow only broadens a step.
        width = float(np.quantile(self._models[usable, 1], _SHARP_QUANTILE))
        self._models[:, 1] = width
        models = fit_steps(profiles, self._models, free_width=False)
        usable = is_known & _is_step(models)
        if np.count_nonzero(usable) < RAYS // 2:
            return
        if abs(width * width - self.variance) > _VARIANCE_STEP * self.variance:
            self.variance = width * width
            self.biases = edge_biases(self.variance)
        edges = models[:, 0]
        directions = np.arange(RAYS)
        for row, reach in enumerate(REACHES):
            near = self._means[:, _INNER - reach : _INNER + reach + 1]
            shifts = np.clip(edges_between(near) - edges, -_MAX_SHIFT_PX, _MAX_SHIFT_PX)
            filled = np.interp(directions, directions[usable], shifts[usable], period=RAYS)
            self.shifts[row] = (filled + np.roll(filled, 1) + np.roll(filled, -1)) / 3.0


def _is_step(models: NDArray[np.float64]) -> NDArray[np.bool_]:
    edges, widths, inside, outside, _ = models.T
    usable = (inside - outside > _MIN_STEP) & (np.abs(edges) < _MAX_EDGE)
    return np.asarray(usable & (widths > _MIN_WIDTH) & (widths < _MAX_WIDTH))


def fit_steps(
    profiles: NDArray[np.float64], start: NDArray[np.float64], *, free_width: bool = True
) -> NDArray[np.float64]:
    """Fit blurred steps from a constant level to a line, by least squares.

    Parameters
    ----------
    profiles : ndarray (n, places)
        Levels 1 px apart.
    start : ndarray (n, 5)
        Edge [px], standard deviation of the blur [px], level inside, level outside at the edge,
        and its slope [1/px].
    free_width : bool
        Whether the standard deviation of the blur is fitted.

    Returns
    -------
    ndarray (n, 5)
    """
    model = start.copy()
    width_weight = 1e-3 if free_width else 1e9
    prior = np.diag([1e-3, width_weight, 1e-6, 1e-6, (_SCATTER / _SLOPE_SPREAD) ** 2])
    for _ in range(_STEPS):
        edge, width, inside, outside, slope = (column[:, None] for column in model.T)
        off = (_PLACES - edge) / width
        covered = ndtr(-off)
        density = np.exp(-0.5 * off * off) / (np.sqrt(2.0 * np.pi) * width)
        floor = outside + slope * (_PLACES - edge)
        step = inside - floor
        residual = profiles - floor - step * covered
        free = 1.0 - covered
        rows = np.stack(
            [
                step * density - slope * free,
                step * density * off,
                covered,
                free,
                (_PLACES - edge) * free,
            ],
            axis=-1,
        )
        normal = np.einsum('npi,npj->nij', rows, rows) + prior
        sides = np.einsum('npi,np->ni', rows, residual)
        sides[:, 4] -= prior[4, 4] * model[:, 4]
        change = np.linalg.solve(normal, sides[..., None])[..., 0]
        model += np.clip(change, [-0.5, -0.4, -60.0, -60.0, -15.0], [0.5, 0.4, 60.0, 60.0, 15.0])
        model[:, 0] = np.clip(model[:, 0], -_MAX_EDGE, _MAX_EDGE)
        model[:, 1] = np.clip(model[:, 1], _MIN_WIDTH, _MAX_WIDTH)
        # A shadow is deepest at the outline.
        model[:, 4] = np.minimum(model[:, 4], 0.0)
    return model


@compiled
def add_profiles(
    levels: NDArray[np.uint8],
    discs: NDArray[np.float64],
    first: int,
    visible_outline: NDArray[np.float64],
    means: NDArray[np.float64],
    counts: NDArray[np.float64],
) -> None:
    """Add profiles across the outlines of free beads to their means; see `OutlineProfiles`.

    `means`, (RAYS, places), and `counts`, (RAYS,), are changed.
    """
    rows, columns = levels.shape
    places = means.shape[1]
    profile = np.empty(places)
    for n in range(visible_outline.size):
        x, y, radius = discs[first + n, 0], discs[first + n, 1], discs[first + n, 2]
        if visible_outline[n] < _MIN_VISIBLE_OUTLINE or radius < _MIN_RADIUS_PX:
            continue
        for k in range(RAYS):
            c, s = COSINES[k], SINES[k]
            end = radius + _OUTER
            end_x, end_y = x + end * c, y + end * s
            if min(end_x, end_y) < 1.0 or end_x > columns - 1.0 or end_y > rows - 1.0:
                continue
            is_free = True
            for other in range(discs.shape[0]):
                dx, dy = discs[other, 0] - end_x, discs[other, 1] - end_y
                near = discs[other, 2] + _CLEARANCE_PX
                is_free &= (dx * dx + dy * dy > near * near) | (other == first + n)
            if not is_free:
                continue
            for t in range(places):
                at = radius + t - _INNER
                column, row = x + at * c - 0.5, y + at * s - 0.5
                j, i = int(column), int(row)
                right, down = column - j, row - i
                upper = levels[i, j] * (1.0 - right) + levels[i, j + 1] * right
                lower = levels[i + 1, j] * (1.0 - right) + levels[i + 1, j + 1] * right
                profile[t] = upper * (1.0 - down) + lower * down
            counts[k] = min(counts[k] + 1.0, _MAX_PROFILES)
            for t in range(places):
                means[k, t] += (profile[t] - means[k, t]) / counts[k]
