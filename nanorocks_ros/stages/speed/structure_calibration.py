"""Calibration of the structure function: image difference against displacement of the beads.

The squared difference of two images in which every bead has moved by d is, for independent
beads, the autocovariance of their appearance: D(d) = 2 [C(0) - C(d)]. The difference of two
images far enough apart in time holds every bead twice, in unrelated places, and nothing that
stands still, so its autocovariance is 2 C(d): neither a background, nor the number of beads,
nor their shading has to be known.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, special

from nanorocks_ros.physics.crowded_grains import picture_correlation, shared_outline
from nanorocks_ros.physics.moving_area import RAYLEIGH_NODES

if TYPE_CHECKING:
    from numpy.typing import NDArray

_GRID_POINTS = 257
# Displacements at which the response is kept: fine enough for straight lines in between.
_STEP_PX = 0.25
_WAVENUMBERS = 600
# Where the response no longer grows, relative errors grow by so much at most.
_FLAT = 100.0
# Quadrature over the displacements of grains between two pictures that are not quite unrelated:
# every so many of the Rayleigh nodes, and directions in half a turn; and rounds of its solution.
_EVERY_NODE = 8
_ANGLES = (np.arange(12) + 0.5) * (np.pi / 12)
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
_ITERATIONS = 3


@cache
def _radial_bins(rows: int, columns: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """For each element of a half spectrum: its bin of |k|, and how often it counts."""
    down = 2.0 * np.pi * np.fft.fftfreq(rows)
    right = 2.0 * np.pi * np.fft.rfftfreq(columns)
    modulus = np.hypot(down[:, np.newaxis], right[np.newaxis, :])
    bins = (modulus * (_WAVENUMBERS / (np.pi * np.sqrt(2.0) * 1.0001))).astype(np.intp)
    weight = np.full(bins.shape, 2.0)
    weight[:, 0] = 1.0
    if columns % 2 == 0:
        weight[:, -1] = 1.0
    return bins.ravel(), (weight / (rows * columns)).ravel()


@cache
def _bessel(longest: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Displacements, and 1 - J0(k d): what a wave changes when moved by d in any direction."""
    displacements = np.arange(0.0, longest + _STEP_PX, _STEP_PX)
    middles = (np.arange(_WAVENUMBERS) + 0.5) * (np.pi * np.sqrt(2.0) * 1.0001 / _WAVENUMBERS)
    return displacements, 1.0 - special.j0(displacements[:, np.newaxis] * middles)


def displacement_response(
    difference: NDArray[np.float32], noise_power: float, longest: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """C(0) - C(d) of the autocovariance C of an image, averaged over directions.

    By the spectrum: exact between whole pixels too, where the response to small displacements
    is decided, and free of white noise, which is a constant there.

    Parameters
    ----------
    difference : ndarray of float32, (rows, columns), [gray levels]
    noise_power : float, [gray levels^2]
        Mean square of the noise in it.
    longest : float, [px]

    Returns
    -------
    displacements, response : ndarray (m,), [px], [gray levels^2]
        From 0 to `longest`.
    """
    rows, columns = difference.shape
    # Padded, so that what leaves on one side does not come in on the other.
    shape = tuple(
        fft.next_fast_len(side + int(np.ceil(longest)), True) for side in (rows, columns)
    )
    spectrum = fft.rfft2(difference, s=shape)
    power = (spectrum.real**2 + spectrum.imag**2).ravel() - noise_power * difference.size
    bins, weight = _radial_bins(*shape)
    radial = np.bincount(bins, weight * power, _WAVENUMBERS)
    displacements, changed = _bessel(longest)
    return displacements, changed @ radial


class StructureCalibration:
    """Mean squared difference of two tray images against the mean displacement between them.

    Parameters
    ----------
    diameter_px : float, [px]
        Mean bead diameter; beads further apart than this in two images share nothing.
    beads : int
        Number of beads, for the error of a mean over so many displacements.
    layers : float, >= 0
        Number of grains above one another, where they hide each other; 0 where they do not.
    """

    def __init__(self, diameter_px: float, beads: int, layers: float = 0.0) -> None:
        self._layers = layers
        self._longest = max(2.0, float(np.ceil(diameter_px)))
        self._beads = beads
        self._at = _bessel(self._longest)[0]
        self._sum = np.zeros_like(self._at)
        self._squares = np.zeros_like(self._at)
        self.pairs = 0
        self._grid = np.linspace(0.0, 2.0 * self._longest, _GRID_POINTS)
        self._power = np.zeros(_GRID_POINTS)
        self._scatter = np.zeros(_GRID_POINTS)

    def add(
        self,
        later: NDArray[np.uint8],
        earlier: NDArray[np.uint8],
        noise_power: float,
        path_px: float = np.inf,
    ) -> None:
        """Learn from two images between which every bead has left its place.

        Parameters
        ----------
        later, earlier : ndarray of uint8, (rows, columns)
        noise_power : float, [gray levels^2]
            Mean squared difference per pixel of a scene at rest.
        path_px : float, [px]
            Mean displacement between the two: some beads have hardly moved, and are made
            up for. Of grains that hide each other it may be a diameter.
        """
        difference = later.astype(np.float32) - earlier.astype(np.float32)
        response = displacement_response(difference, noise_power, self._longest)[1]
        if self._layers > 0.0:
            response = self._unrelated(response, path_px)
        else:
            response /= self._moved_share(response, path_px)
        self._sum += response
        self._squares += response**2
        self.pairs += 1
        self._tabulate()

    def _moved_share(self, response: NDArray[np.float64], path_px: float) -> float:
        if not np.isfinite(path_px) or response[-1] <= 0.0:
            return 1.0
        moved = np.interp(path_px * RAYLEIGH_NODES, self._at, response)
        return float(max(moved.mean() / response[-1], 0.1))

    def _unrelated(
        self, response: NDArray[np.float64], displacement_px: float
    ) -> NDArray[np.float64]:
        """Response of unrelated pictures, from that of two which still have grains in common.

        The difference of two pictures has the autocovariance 2 C(d) - 2 X(d), with X the
        covariance of one with the other: of the same grains, displaced.
        """
        if not np.isfinite(displacement_px) or response[-1] <= 0.0:
            return response
        moved = displacement_px * RAYLEIGH_NODES[_EVERY_NODE // 2 :: _EVERY_NODE, np.newaxis]
        apart = np.hypot(self._at[:, np.newaxis, np.newaxis] - moved * _COSINES, moved * _SINES)
        unrelated = response
        for _ in range(_ITERATIONS):
            plateau = float(unrelated[-1])
            correlation = np.clip(1.0 - unrelated / plateau, 0.0, 1.0)
            shared = shared_outline(correlation, self._layers)
            common = np.interp(apart, self._at, shared).mean(axis=(1, 2))
            left = picture_correlation(common, self._layers)
            unrelated = response + plateau * (left[0] - left)
        return unrelated

    def _tabulate(self) -> None:
        mean = np.maximum.accumulate(self._sum / self.pairs)
        at = np.interp(self._grid[:, np.newaxis] * RAYLEIGH_NODES, self._at, mean)
        self._power = at.mean(axis=1) if self._layers == 0.0 else self._hidden_power(mean)
        slope = np.gradient(self._power, self._grid)
        residual = at - slope[:, np.newaxis] * self._grid[:, np.newaxis] * RAYLEIGH_NODES
        steep = slope > 1e-3 * slope.max()
        self._scatter = np.divide(
            residual.std(axis=1), slope * np.sqrt(self._beads), where=steep, out=self._grid.copy()
        )

    def _hidden_power(self, response: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared difference of grains that hide each other, on the grid.

        Together, as in the response, they uncover less than when each moves by itself.
        """
        plateau = float(response[-1])
        if plateau <= 0.0:
            return np.zeros_like(self._grid)
        correlation = np.clip(1.0 - response / plateau, 0.0, 1.0)
        shared = shared_outline(correlation, self._layers)
        displaced = self._grid[:, np.newaxis] * RAYLEIGH_NODES
        mean_share = np.interp(displaced, self._at, shared).mean(axis=1)
        return plateau * (1.0 - picture_correlation(mean_share, self._layers))

    @property
    def plateau(self) -> float:
        """Squared difference once every bead has left its place, [gray levels^2]."""
        return float(self._power[-1])

    def displacement(self, power: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean displacement behind squared differences already free of noise.

        Parameters
        ----------
        power : ndarray, [gray levels^2]

        Returns
        -------
        ndarray, [px]
            0 where the noise was overestimated and nothing is left.
        """
        return np.interp(power, self._power, self._grid)

    def displacement_error(
        self, power: NDArray[np.float64], noise_power: float, pixels: int
    ) -> NDArray[np.float64]:
        """One standard error of :meth:`displacement` of the same squared differences, [px].

        Three parts: a finite number of beads, whose squared differences are not
        proportional to their displacements; sensor noise; the spread of the response over
        the image pairs it was learnt from, for it differs from one arrangement of the beads
        to the next.
        """
        displacement = self.displacement(power)
        finite = np.interp(displacement, self._grid, self._scatter)
        noise_sd = noise_power * np.sqrt(2.0 * pixels)
        noise = 0.5 * (self.displacement(power + noise_sd) - self.displacement(power - noise_sd))
        arrangement = self._arrangement_error() * self._steepness(displacement) * displacement
        return np.sqrt(finite**2 + noise**2 + arrangement**2)

    def _steepness(self, displacement: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative change of a displacement over that of the power, 1 at least.

        Near the plateau the power hardly grows, and any error of it counts many times.
        """
        slope = np.gradient(self._power, self._grid)
        change = np.divide(
            self._power,
            slope * self._grid,
            where=slope * self._grid > 0.0,
            out=np.full_like(self._grid, _FLAT),
        )
        steepness = np.interp(displacement, self._grid, np.clip(change, 1.0, _FLAT))
        return np.asarray(steepness)

    def _arrangement_error(self) -> float:
        mean = self._sum / self.pairs
        middle = self._at.size // 4
        variance = max(0.0, float(self._squares[middle] / self.pairs - mean[middle] ** 2))
        spread = np.sqrt(variance * (1.0 + 1.0 / self.pairs))
        return float(spread / mean[middle]) if mean[middle] > 0 else 1.0
