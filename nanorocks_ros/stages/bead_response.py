"""How much an image changes when its beads move: learnt from the images themselves.

The squared difference of two images in which every bead has moved by d is, for independent
beads, the autocovariance of their appearance: D(d) = 2 [C(0) - C(d)]. The difference of two
images far enough apart in time holds every bead twice, in unrelated places, and nothing that
stands still, so its autocovariance is 2 C(d): neither a background, nor the number of beads,
nor their shading has to be known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from nanorocks_ros.physics.moving_area import RAYLEIGH_NODES

if TYPE_CHECKING:
    from numpy.typing import NDArray

_GRID_POINTS = 257


def radial_autocovariance(difference: NDArray[np.float32], longest: int) -> NDArray[np.float64]:
    """Autocovariance of an image, averaged over directions, at whole displacements.

    Parameters
    ----------
    difference : ndarray of float32, (rows, columns), [gray levels]
    longest : int, [px]
        Largest displacement.

    Returns
    -------
    ndarray, (longest + 1,), [gray levels^2]
        Sums over all pixels, at 0, 1, ... `longest` px.
    """
    rows, columns = difference.shape
    shape = (fft.next_fast_len(rows + longest, True), fft.next_fast_len(columns + longest, True))
    spectrum = fft.rfft2(difference, s=shape)
    power = spectrum.real**2 + spectrum.imag**2
    covariance = fft.irfft2(power, s=shape)
    y = np.arange(-longest, longest + 1)
    window = covariance[np.ix_(y, y)]
    radius = np.hypot(y[:, np.newaxis], y[np.newaxis, :])
    near = radius < longest
    lower = np.floor(radius[near]).astype(np.intp)
    share = radius[near] - lower
    value = window[near]
    # Linear shares to the two whole displacements on either side: a straight line through
    # zero, which D nearly is, comes back exactly.
    index = np.concatenate((lower, lower + 1))
    weight = np.concatenate((1.0 - share, share))
    total = np.bincount(index, weight * np.concatenate((value, value)), longest + 1)
    radial: NDArray[np.float64] = total / np.bincount(index, weight, longest + 1)
    radial[0] = covariance[0, 0]
    return radial


class BeadResponse:
    """Mean squared difference of two tray images against the mean displacement between them.

    Parameters
    ----------
    diameter_px : float, [px]
        Mean bead diameter; beads further apart than this in two images share nothing.
    beads : int
        Number of beads, for the error of a mean over so many displacements.
    """

    def __init__(self, diameter_px: float, beads: int) -> None:
        self._longest = max(2, int(np.ceil(diameter_px)))
        self._beads = beads
        self._sum = np.zeros(self._longest + 1)
        self._squares = np.zeros(self._longest + 1)
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
            up for.
        """
        difference = later.astype(np.float32) - earlier.astype(np.float32)
        covariance = radial_autocovariance(difference, self._longest)
        covariance[0] -= noise_power * difference.size
        response = covariance[0] - covariance
        response /= self._moved_share(response, path_px)
        self._sum += response
        self._squares += response**2
        self.pairs += 1
        self._tabulate()

    def _moved_share(self, response: NDArray[np.float64], path_px: float) -> float:
        if not np.isfinite(path_px) or response[-1] <= 0.0:
            return 1.0
        moved = np.interp(path_px * RAYLEIGH_NODES, np.arange(response.size), response)
        return float(max(moved.mean() / response[-1], 0.1))

    def _tabulate(self) -> None:
        mean = np.maximum.accumulate(self._sum / self.pairs)
        at = np.interp(self._grid[:, np.newaxis] * RAYLEIGH_NODES, np.arange(mean.size), mean)
        self._power = at.mean(axis=1)
        slope = np.gradient(self._power, self._grid)
        residual = at - slope[:, np.newaxis] * self._grid[:, np.newaxis] * RAYLEIGH_NODES
        steep = slope > 1e-3 * slope.max()
        self._scatter = np.divide(
            residual.std(axis=1), slope * np.sqrt(self._beads), where=steep, out=self._grid.copy()
        )

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
        the image pairs it was learnt from.
        """
        displacement = self.displacement(power)
        finite = np.interp(displacement, self._grid, self._scatter)
        noise_sd = noise_power * np.sqrt(2.0 * pixels)
        noise = 0.5 * (self.displacement(power + noise_sd) - self.displacement(power - noise_sd))
        return np.sqrt(finite**2 + noise**2 + (self._learning_error() * displacement) ** 2)

    def _learning_error(self) -> float:
        mean = self._sum / self.pairs
        middle = self._longest // 4
        variance = max(0.0, float(self._squares[middle] / self.pairs - mean[middle] ** 2))
        return float(np.sqrt(variance / self.pairs) / mean[middle]) if mean[middle] > 0 else 1.0
