"""One gray image per species from a colour image, in which only the beads of that species show.

Shading darkens a bead and keeps the proportions of its colour, and a highlight adds white; so the
species are separated by hue, the direction in which blue and red differ from green. Grains without
a hue are darker than the floor. Hues are learnt from one image of the tray, starting from the
colour of the material; a table over all colours then holds how much of each species a pixel shows.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.numerics.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# The table has this many steps for each of the three colours.
_STEPS = 64
_PER_STEP = 256 // _STEPS
_ROUNDS = 10
# From this saturation on a pixel shows a coloured bead, [gray levels].
_COLOURED = 40.0
# Over this range of saturation a pixel goes from gray grain to none, [gray levels].
_GRAY_UP_TO, _NO_LONGER_GRAY = 15.0, 45.0
# Over this range of saturation a hue goes from unknown to known, [gray levels].
_FAINT, _CLEAR = 12.0, 24.0
# Level of the floor in the images, so that the noise there is not cut off.
_ZERO = 64
# Difference of the cosines of two hues over which a colour goes from one to the other.
_WIDTH = 0.3
# Cosine between two hues that a camera cannot tell apart.
_ALIKE = 0.9
# Smallest share of the area of its beads that a species must show.
_SMALLEST_AREA_SHARE = 0.2


class SpeciesImages:
    """Separates the species of a tray by their colours.

    Parameters
    ----------
    tray : Tray
    pixels_per_metre : float, [px/m]
    """

    def __init__(self, tray: Tray, pixels_per_metre: float) -> None:
        self._materials = tuple(species.properties for species in tray.species)
        self._areas = np.array(
            [
                0.25 * np.pi * species.count * species.diameter**2 * pixels_per_metre**2
                for species in tray.species
            ]
        )
        self._tables: NDArray[np.uint8] | None = None

    @property
    def possible(self) -> bool:
        """Whether there are several species, at most one of them gray."""
        grays = sum(material.hue == 0 for material in self._materials)
        return len(self._materials) > 1 and grays < 2

    @property
    def learnt(self) -> bool:
        """Whether the colours have been learnt."""
        return self._tables is not None

    def learn(self, color: NDArray[np.uint8]) -> bool:
        """Learn the colours from an image; False when it does not show every species.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr
        """
        pixels = color.reshape(-1, 3).astype(np.float64)
        floor = self._floor(pixels)
        tints = _tint(pixels - floor)
        tints = tints[np.linalg.norm(tints, axis=1) > _COLOURED]
        coloured = [k for k, material in enumerate(self._materials) if material.hue]
        hues = _unit(
            np.array([_tint(np.array(self._materials[k].color) - floor) for k in coloured])
        )
        for _ in range(_ROUNDS):
            nearest = (tints @ hues.T).argmax(axis=1)
            shown = np.bincount(nearest, minlength=len(hues))
            if (shown < _SMALLEST_AREA_SHARE * self._areas[coloured]).any():
                return False
            hues = _unit(np.array([tints[nearest == k].sum(axis=0) for k in range(len(hues))]))
        if (hues @ hues.T - np.eye(len(hues))).max() > _ALIKE:
            return False
        self._tables = _tables(floor, hues, coloured, len(self._materials))
        return True

    def _floor(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Colour of the floor: the median of the pixels that no bead covers."""
        bare = np.exp(-self._areas.sum() / len(pixels))
        return np.asarray(np.percentile(pixels, 100.0 * (1.0 - 0.5 * bare), axis=0))

    def images(self, color: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], ...]:
        """One gray image for each species.

        Parameters
        ----------
        color : ndarray of uint8, (rows, columns, 3), bgr

        Returns
        -------
        tuple of ndarray of uint8, (rows, columns)
            In the order of `Tray.species`; near 64 where the species does not show.
        """
        assert self._tables is not None
        images = np.empty((len(self._tables), *color.shape[:2]), dtype=np.uint8)
        _look_up(color, self._tables, images)
        return tuple(images)


def _tint(away: NDArray[np.float64]) -> NDArray[np.float64]:
    """Blue and red less green, which white light and shadow do not change."""
    return np.stack((away[..., 0] - away[..., 1], away[..., 2] - away[..., 1]), axis=-1)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _tables(
    floor: NDArray[np.float64], hues: NDArray[np.float64], coloured: list[int], n_species: int
) -> NDArray[np.uint8]:
    """Share of each species in every colour, (n_species, steps^3)."""
    levels = (np.arange(_STEPS) + 0.5) * _PER_STEP
    grid = np.stack(np.meshgrid(levels, levels, levels, indexing='ij'), axis=-1).reshape(-1, 3)
    away = grid - floor
    tint = _tint(away)
    strength = np.maximum(np.linalg.norm(tint, axis=1), 1e-9)
    cosines = tint @ hues.T / strength[:, np.newaxis]
    # The noise of the floor has a random hue; it is kept, as it is on a bead.
    hued = np.clip((strength - _FAINT) / (_CLEAR - _FAINT), 0.0, 1.0)
    amounts = np.zeros((n_species, len(grid)))
    for column, k in enumerate(coloured):
        others = np.delete(cosines, column, axis=1).max(axis=1, initial=-1.0)
        share = np.clip(0.5 + (cosines[:, column] - others) / _WIDTH, 0.0, 1.0)
        amounts[k] = (share * hued + (1.0 - hued)) * (tint @ hues[column])
    gray = np.clip((_NO_LONGER_GRAY - strength) / (_NO_LONGER_GRAY - _GRAY_UP_TO), 0.0, 1.0)
    for k in set(range(n_species)) - set(coloured):
        amounts[k] = -gray * away.mean(axis=1)
    return np.asarray(np.clip(np.round(_ZERO + amounts), 0, 255).astype(np.uint8))


@compiled
def _look_up(
    color: NDArray[np.uint8], tables: NDArray[np.uint8], images: NDArray[np.uint8]
) -> None:
    rows, columns, _ = color.shape
    places = np.empty(columns, dtype=np.uint32)
    # Row by row, one species after the other: short loops are vectorised.
    for i in range(rows):
        for j in range(columns):
            blue = np.uint32(color[i, j, 0]) // np.uint32(_PER_STEP)
            green = np.uint32(color[i, j, 1]) // np.uint32(_PER_STEP)
            red = np.uint32(color[i, j, 2]) // np.uint32(_PER_STEP)
            places[j] = (blue * _STEPS + green) * _STEPS + red
        for k in range(images.shape[0]):
            table, shown = tables[k], images[k, i]
            for j in range(columns):
                shown[j] = table[np.uint64(places[j])]
