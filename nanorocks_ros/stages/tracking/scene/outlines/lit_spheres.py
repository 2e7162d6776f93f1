"""The outline of a sphere that is lit from one side, by the mean picture of all beads of a film.

The shaded side of a bead may be as dark as the floor: the steepest place on a ray is where the
light ends, and beads look smaller than they are, and displaced towards the light. All beads of a
film have one light, so that the shift is the same part of the radius in all of them.

Tested by ``test/stages/tracking/scene/test_lit_views.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np
from scipy.optimize import OptimizeResult, least_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

# The mean bead reaches so far, and has so many pixels across, each of this many a side for what
# is computed of it.
_REACH, _PIXELS, _FINER = 1.4, 43, 2
# What is compared lies between these parts of the radius: highlights are farther inside.
_COMPARED = 0.7, 1.35
# Beads of which no other one is nearer than so many radii; so many at least tell the light, and
# so many are enough.
_ALONE, _LEAST_BEADS, _ENOUGH_BEADS = 2.3, 8, 150
# The part of them whose surroundings are most alike.
_ALIKE = 0.7
# Exponents of the light in gray levels: cameras that keep the light, and usual video, which counts
# where it explains so many times more, and what is off by more than this part of the contrast.
_EXPONENTS, _CLEARLY, _WELL = (1.0, 2.2), 1.6, 0.004
# Where the fit starts: radius, blur, and tangent of the angle of the light from above.
_START = 1.05, 0.09, 0.7
# What is tried of radius and blur.
_LEAST_RADIUS, _BLURS = 0.3, (0.01, 0.5)
# Place and radius of the disc, and the part of it that tells where the light comes from.
_DISC, _INSIDE = (0.0, 0.0, 1.0), 0.8
# Typical changes of the parameters of a sphere, and of an ellipsoid beside them.
_TYPICAL, _TYPICAL_STRETCH = (0.05, 0.05, 0.05, 0.03, 0.3, 0.3), (0.1, 0.1)
# The stretch of a sphere.
_ROUND = np.zeros(2)
# Amounts are small where shapes hardly differ.
_RIDGE = 1e-10
_DERIVATIVE_STEP, _MOST_EVALUATIONS, _TOLERANCE = 1e-2, 200, 1e-4
# Light from aside at an angle whose tangent is 1 is as unlikely as so much of the contrast off.
# Where the light is known, other angles are so many times less likely.
_STEEP, _SURE = 0.001, 100.0
# The mean bead is that of a lit sphere where it differs from it by less than this part of its
# contrast, of at least so many gray levels.
_MOST_OFF, _LEAST_CONTRAST = 0.02, 12.0
# Smaller beads are mostly blur, [px].
_LEAST_RADIUS_PX = 5.0
# Light displaces discs where the bead lies so far off, or is so much larger, in radii: not as far
# as beyond a shaded half, and not smaller, which clear beads seem to be. Where it lies off by less
# than is clear, the sphere has to differ so many times less than one with the disc itself.
_OFF_PLACE, _OFF_RADIUS, _MOST = 0.015, 0.025, 0.3
_CLEAR_PLACE, _CLEAR_GAIN = 0.03, 1.4


class LitSphere(NamedTuple):
    """Where a bead is, seen from the disc that its edges show, in radii of this.

    Parameters
    ----------
    across, down : float
        From the centre of the disc to that of the bead.
    radius : float
    off : float
        Root of the mean square of what the mean bead differs by, over its contrast.
    gain : float
        The same of an ellipsoid with place and radius of the disc, as balls show in views that
        are rectified, over `off`; 1 if light does not shift the disc.
    slope : tuple of 2 floats
        Tangent of the angle of the light from above, across and down.
    exponent : float
        Of the light in gray levels.
    """

    across: float
    down: float
    radius: float
    off: float
    gain: float
    slope: tuple[float, float]
    exponent: float

    @property
    def shifts(self) -> bool:
        """Whether light makes beads look smaller, or nearer to it, by more than counts."""
        away = math.hypot(self.across, self.down)
        return self.may_shift and self.gain > (1.0 if away > _CLEAR_PLACE else _CLEAR_GAIN)

    @property
    def may_shift(self) -> bool:
        """The same, whatever the gain."""
        away, larger = math.hypot(self.across, self.down), self.radius - 1.0
        return (
            self.off < _MOST_OFF
            and -_OFF_RADIUS < larger < _MOST
            and away < _MOST
            and (away > _OFF_PLACE or larger > _OFF_RADIUS)
        )

    def of(self, discs: NDArray[np.float64]) -> NDArray[np.float64]:
        """The beads that show as these discs, (n, 3)."""
        shift = np.array([self.across, self.down])
        places = discs[:, :2] + discs[:, 2:] * shift
        return np.column_stack([places, self.radius * discs[:, 2]])


def lit_sphere(
    frames: Sequence[NDArray[np.uint8]],
    discs: Sequence[NDArray[np.float64]],
    sizes: tuple[float, float] = (0.0, math.inf),
    like: LitSphere | None = None,
) -> LitSphere | None:
    """Where the beads are that show as discs; None where too few lie alone, or none stands out.

    Parameters
    ----------
    frames : sequence of ndarrays of uint8, (rows, columns, 3), bgr
    discs : sequence of ndarrays (n, 3), [px]
        Of each frame: column, row, radius.
    sizes : tuple of 2 floats, optional, [px]
        Radii of those that are looked at.
    like : LitSphere, optional
        Of beads of another size, in the same light.
    """
    every = np.concatenate([rows[:, 2] for rows in discs])
    every = every[(every >= sizes[0]) & (every < sizes[1])]
    if len(every) < _LEAST_BEADS or np.median(every) < _LEAST_RADIUS_PX:
        return None
    mean = _mean_bead(frames, discs, sizes)
    if mean is None:
        return None
    if like is not None:
        return _fitted(mean, like.exponent, like.slope)
    best = _fitted(mean, _EXPONENTS[0])
    if best is None or not best.may_shift or best.off < _WELL:
        return best
    other = _fitted(mean, _EXPONENTS[1])
    return other if other is not None and _CLEARLY * other.off < best.off else best


def _mean_bead(
    frames: Sequence[NDArray[np.uint8]],
    discs: Sequence[NDArray[np.float64]],
    sizes: tuple[float, float],
) -> NDArray[np.float64] | None:
    """Mean picture of the beads that lie alone, (_PIXELS, _PIXELS, 3)."""
    across, down = _places(_PIXELS)
    patches: list[NDArray[np.float32]] = []
    for frame, rows in zip(frames, discs, strict=True):
        image = frame.astype(np.float32)
        for column, row, radius in alone(rows, frame.shape):
            if not sizes[0] <= radius < sizes[1]:
                continue
            x, y = (column + radius * across, row + radius * down)
            patches.append(
                np.asarray(
                    cv2.remap(image, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
                )
            )
    if len(patches) < _LEAST_BEADS:
        return None
    every = np.stack(patches[:: math.ceil(len(patches) / _ENOUGH_BEADS)])
    outside = np.hypot(across, down) > 1.0
    around = every[:, outside]
    unlike = np.abs(around - np.median(around, axis=0)).mean(axis=(1, 2))
    chosen = unlike <= np.quantile(unlike, _ALIKE)
    return np.asarray(every[chosen].mean(axis=0, dtype=np.float64))


def alone(
    discs: NDArray[np.float64], shape: tuple[int, ...]
) -> Iterator[tuple[float, float, float]]:
    """Discs (n, 3) that lie wholly in a picture, without others beside: column, row, radius."""
    for k, (column, row, radius) in enumerate(discs.tolist()):
        others = np.delete(discs, k, axis=0)
        away = np.hypot(others[:, 0] - column, others[:, 1] - row)
        reach = _REACH * radius
        inside = reach <= column < shape[1] - 1 - reach and reach <= row < shape[0] - 1 - reach
        if inside and (away > _ALONE * np.maximum(others[:, 2], radius)).all():
            yield column, row, radius


def _places(pixels: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns and rows of the middles of pixels, in radii."""
    pitch = 2.0 * _REACH / pixels
    middles = pitch * (np.arange(pixels) - 0.5 * (pixels - 1))
    down, across = np.meshgrid(middles, middles, indexing='ij')
    return across, down


def _fitted(
    mean: NDArray[np.float64], exponent: float, slope: tuple[float, float] | None = None
) -> LitSphere | None:
    """The sphere that explains a mean bead, by least squares; None where it hardly stands out.

    Its surface scatters light evenly (Lambert, Photometria, 1760): that of one lamp, and what is
    all around, brighter on one side. The floor is a quadratic function of the place. The slope
    of the light may be known.
    """
    light = 255.0 * (mean / 255.0) ** exponent
    contrast = float(np.quantile(light, 0.98) - np.quantile(light, 0.05))
    if contrast < _LEAST_CONTRAST:
        return None
    x, y = _places(_PIXELS)
    away = np.hypot(x, y)
    compared = (away > _COMPARED[0]) & (away < _COMPARED[1])
    values = light[compared]
    weight = _STEEP * contrast * math.sqrt(values.size)
    bright = light.sum(axis=2) - light[away < 1.0].sum(axis=1).mean()
    inside = away < _INSIDE
    towards = np.array([(bright * x)[inside].sum(), (bright * y)[inside].sum()])
    towards /= max(float(np.hypot(*towards)), 1e-9)

    def off(
        parameters: NDArray[np.float64], stretch: NDArray[np.float64] = _ROUND
    ) -> NDArray[np.float64]:
        shapes = _shapes(parameters, stretch)[compared]
        normal = shapes.T @ shapes
        normal += _RIDGE * np.trace(normal) * np.eye(len(normal))
        amounts = np.linalg.solve(normal, shapes.T @ values)
        steep = weight * (parameters[4:] - usual)
        return np.concatenate([np.ravel(values - shapes @ amounts), steep])

    radius, blur, tangent = _START
    usual, first = np.zeros(2), tangent * towards
    if slope is not None:
        usual, first, weight = np.array(slope), np.array(slope), _SURE * weight
    fit = _least(off, np.array([*(-0.05 * towards), radius, blur, *first]), _TYPICAL)
    root = math.sqrt(2.0 * fit.cost / values.size)
    across, down, radius = fit.x[: len(_DISC)].tolist()
    light_across, light_down = fit.x[-2:].tolist()
    towards_light = light_across, light_down
    sphere = LitSphere(across, down, radius, root / contrast, 1.0, towards_light, exponent)
    if not sphere.may_shift:
        return sphere
    as_seen = _least(
        lambda parameters: off(np.concatenate([_DISC, parameters[:-2]]), parameters[-2:]),
        np.concatenate([fit.x[len(_DISC) :], _ROUND]),
        _TYPICAL[len(_DISC) :] + _TYPICAL_STRETCH,
    )
    return sphere._replace(gain=math.sqrt(as_seen.cost / max(fit.cost, 1e-12)))


def _least(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    start: NDArray[np.float64],
    typical: tuple[float, ...],
) -> OptimizeResult:
    return least_squares(
        function,
        start,
        method='lm',
        x_scale=np.array(typical),
        diff_step=_DERIVATIVE_STEP,
        max_nfev=_MOST_EVALUATIONS,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
    )


def _shapes(parameters: NDArray[np.float64], stretch: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the picture of a lit sphere is a sum of, (_PIXELS, _PIXELS, n).

    Parameters
    ----------
    parameters : ndarray (6,)
        Column and row of the centre, radius, blur; slope of the light across and down.
    stretch : ndarray (2,)
        Of an ellipsoid: across beyond down, and along one diagonal beyond the other.
    """
    column, row, radius, blur, slope_across, slope_down = parameters.tolist()
    radius, blur = max(radius, _LEAST_RADIUS), min(max(abs(blur), _BLURS[0]), _BLURS[1])
    fine = _FINER * _PIXELS
    across, down = _places(fine)
    x, y = (across - column) / radius, (down - row) / radius
    x, y = (
        (1.0 - stretch[0]) * x - stretch[1] * y,
        (1.0 + stretch[0]) * y - stretch[1] * x,
    )
    square = x * x + y * y
    pitch = 2.0 * _REACH / fine
    cover = np.clip((1.0 - np.sqrt(square)) * radius / pitch + 0.5, 0.0, 1.0)
    up = np.sqrt(np.clip(1.0 - square, 0.0, 1.0))
    beyond = np.sqrt(np.maximum(square, 1.0))
    x, y = x / beyond, y / beyond
    lamp = np.maximum(slope_across * x + slope_down * y + up, 0.0)
    lamp /= math.sqrt(1.0 + slope_across**2 + slope_down**2)
    bead = [cover * part for part in (1.0, x, y, up, lamp)]
    terms = 1.0, across, down, across * across, across * down, down * down
    floor = [(1.0 - cover) * part for part in terms]
    shapes = np.stack([*bead, *floor], axis=2).astype(np.float32)
    blurred = np.stack(
        [cv2.GaussianBlur(part, (0, 0), blur / pitch) for part in np.moveaxis(shapes, 2, 0)],
        axis=2,
    )
    parts = blurred.reshape(_PIXELS, _FINER, _PIXELS, _FINER, -1)
    return np.asarray(parts.mean(axis=(1, 3)), dtype=np.float64)
