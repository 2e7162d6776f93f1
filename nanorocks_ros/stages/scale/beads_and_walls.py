"""Whether the floor of a tray can be where it is said to be: no bead is inside a wall.

Tested by ``test/stages/scale/test_beads_and_walls.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nanorocks_ros.stages.tracking.detection.bead_detector import BeadDetector

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.plate import Region
    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import TrackingSettings

# Around a region, beads are looked for so many diameters of the largest of them far.
_MARGIN = 1.0
# Less of the outline of a disc may be that of a shadow or of an edge of the tray.
_VISIBLE = 0.5
# Beads are oval by some 12 %, and seen at an angle: share of the radius that may lie beyond a
# wall, beside the error of a side, [px].
_BEYOND, _SIDE_PX = 0.3, 2.0
# A single disc may be a stain or a shadow.
_LEAST_CUT = 2


class SeenBeads(NamedTuple):
    """Beads with a colour of their own in a picture.

    Parameters
    ----------
    centres : ndarray (n, 2), [px]
        Column and row; the centre of the first pixel is at (0.5, 0.5).
    radii : ndarray (n,), [px]
    """

    centres: NDArray[np.float64]
    radii: NDArray[np.float64]

    def cut_by(self, floor: tuple[float, float, float, float]) -> int:
        """How many beads the sides of a floor would cut; those wholly outside are of other trays.

        Parameters
        ----------
        floor : tuple of 4 floats, [px]
            Left, top, width and height.
        """
        first = np.array(floor[:2])
        last = first + floor[2:]
        own = self.radii[:, np.newaxis]
        beyond = np.maximum(first - self.centres, self.centres - last) + own
        farthest = beyond.max(axis=1)
        cut = (farthest > _BEYOND * self.radii + _SIDE_PX) & (farthest < 2.0 * self.radii)
        return int(cut.sum())

    def contradict(self, floor: tuple[float, float, float, float]) -> bool:
        """Whether a floor cannot be there: a wall cuts no bead."""
        return self.cut_by(floor) >= _LEAST_CUT


def beads_around(
    image: NDArray[np.uint8],
    region: Region,
    tray: Tray,
    settings: TrackingSettings,
    pixels_per_metre: float,
) -> SeenBeads:
    """The beads in and around a region; gray grains look like texture and are left out.

    Parameters
    ----------
    image : ndarray of uint8, (height, width, 3), bgr
    region : Region
    tray : Tray
    settings : TrackingSettings
    pixels_per_metre : float, [px/m]
    """
    largest = max(species.diameter_high for species in tray.species)
    margin = round(_MARGIN * largest * pixels_per_metre)
    left, top = max(region.x - margin, 0), max(region.y - margin, 0)
    right, bottom = region.x + region.width + margin, region.y + region.height + margin
    detector = BeadDetector(settings, tray, pixels_per_metre)
    detections = detector.detect(image[top:bottom, left:right])
    centres, radii = [np.empty((0, 2))], [np.empty(0)]
    for species, detected in zip(tray.species, detections, strict=True):
        if species.properties.hue == 0:
            continue
        whole = detected.visible_outline > _VISIBLE
        centres.append(detected.positions[whole] + (left, top))
        radii.append(detected.radii[whole])
    return SeenBeads(np.concatenate(centres), np.concatenate(radii))
