"""The scale by the beads in a single picture, before any bead is tracked."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.scale.bead_radii import alike, measurable, radius_scale
from nanorocks_ros.stages.scale.rulers import TOLERANCE
from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector
from nanorocks_ros.stages.tracking.linking.track_snapshot import BLUR_BIAS_PX2

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import TrackingSettings

# Times that the scale is set to that of the beads and these are measured again.
_REPEATS = 4
# Measured at this scale itself, radii are those that are looked for: relative difference.
_SETTLED = 0.01
# Farther from the scale at which they are looked for, discs are no beads: relative difference.
_REACH = 0.2
# Scales that are tried from the largest at which the tray fits downwards: ratio and number.
_STEP, _STEPS = 1.12, 16
# Margin around a floor, in diameters of the largest beads: a crop that is too small hides beads.
_MARGIN = 1.0


class PictureScale(NamedTuple):
    """The scale by the radii of beads in a picture.

    Parameters
    ----------
    pixels_per_metre : float, [px/m]
    error : float
        Relative.
    """

    pixels_per_metre: float
    error: float

    def agrees(self, pixels_per_metre: float, tolerance: float = TOLERANCE) -> bool:
        """Whether another scale is the same within a tolerance beside three standard errors."""
        difference = abs(math.log(pixels_per_metre / self.pixels_per_metre))
        return difference <= tolerance + 3.0 * self.error


def scale_near(
    color: NDArray[np.uint8],
    tray: Tray,
    settings: TrackingSettings,
    pixels_per_metre: float,
) -> PictureScale | None:
    """The scale by the beads, near one that is given; None when they do not tell.

    Parameters
    ----------
    color : ndarray of uint8, (rows, columns, 3), bgr
        With the floor of the tray in its middle.
    tray : Tray
    settings : TrackingSettings
    pixels_per_metre : float, [px/m]
    """
    scale, error = pixels_per_metre, 0.0
    for _ in range(_REPEATS):
        measured = _at_scale(_cut(color, tray, scale), tray, settings, scale)
        if measured is None:
            return None
        ratio, error = measured
        scale *= ratio
        if abs(math.log(scale / pixels_per_metre)) > _REACH:
            return None
        if abs(ratio - 1.0) < _SETTLED:
            return PictureScale(scale, error)
    return None


def scale_of_picture(
    color: NDArray[np.uint8], tray: Tray, settings: TrackingSettings
) -> PictureScale | None:
    """The scale by the beads in the middle of a picture, of which nothing is known.

    All scales are tried at which the tray fits into the picture, down to a sixth of the largest.
    """
    rows, columns = color.shape[:2]
    scale = min(columns / tray.dimensions[0], rows / tray.dimensions[1])
    candidates: list[PictureScale] = []
    for _ in range(_STEPS):
        near = scale_near(color, tray, settings, scale)
        if near is not None:
            candidates.append(near)
        scale /= _STEP
    if not candidates:
        return None
    best = min(candidates, key=lambda candidate: candidate.error)
    # Where two scales fit, none is known.
    unique = all(best.agrees(other.pixels_per_metre) for other in candidates)
    return best if unique else None


def around(image: NDArray[np.uint8], region: Region) -> NDArray[np.uint8]:
    """The largest part of a picture that has the middle of a region in its middle."""
    x, y = region.x + 0.5 * region.width, region.y + 0.5 * region.height
    half_width, half_height = min(x, image.shape[1] - x), min(y, image.shape[0] - y)
    left, right = math.ceil(x - half_width), math.floor(x + half_width)
    top, bottom = math.ceil(y - half_height), math.floor(y + half_height)
    return np.ascontiguousarray(image[max(top, 0) : bottom, max(left, 0) : right])


def _cut(color: NDArray[np.uint8], tray: Tray, scale: float) -> NDArray[np.uint8]:
    """The middle of a picture: the floor at a scale and some margin."""
    margin = _MARGIN * max(species.diameter_high for species in tray.species)
    rows, columns = color.shape[:2]
    width = min(columns, round((tray.dimensions[0] + 2.0 * margin) * scale))
    height = min(rows, round((tray.dimensions[1] + 2.0 * margin) * scale))
    left, top = (columns - width) // 2, (rows - height) // 2
    return np.ascontiguousarray(color[top : top + height, left : left + width])


def _at_scale(
    color: NDArray[np.uint8], tray: Tray, settings: TrackingSettings, scale: float
) -> tuple[float, float] | None:
    """Radii of beads of one size over those looked for, and the error of the ratio."""
    detector = BeadDetector(settings, tray, scale)
    # The first pass takes the background from the picture itself.
    detections = detector.detect(color)
    ratios = []
    for species, detected in zip(tray.species, detections, strict=True):
        if not (alike(species) and measurable(tray, species)):
            continue
        whole = detected.visible_outline > 0.5
        if whole.sum() > 1.2 * species.count:
            return None
        radii = detected.radii[whole]
        errors = BLUR_BIAS_PX2 / radii
        ratio = radius_scale(species, radii / scale, errors / scale, 1)
        if ratio is not None:
            ratios.append(ratio)
    return min(ratios, key=lambda ratio: ratio[1]) if ratios else None
