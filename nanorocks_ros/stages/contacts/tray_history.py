"""The last frames of a tray: its velocity, its granular temperature, and beads near a contact."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nanorocks_ros.inference.contacts.rebound_reading import SWING_ERROR
from nanorocks_ros.numerics.compiled import compiled
from nanorocks_ros.numerics.median import median_of
from nanorocks_ros.stages.contacts.oscillation_fit import (
    SwingDecay,
    fit_slope,
    oscillation_terms,
    polynomial_terms,
    swing_speed,
)

if TYPE_CHECKING:
    from nanorocks_ros.records import Tracks

# Frames on each side that the velocity of the tray is fitted to: for an oscillation or a line, and
# for a cubic.
_WIDE_FRAMES, _NARROW_FRAMES = 45, 4
_MIN_FRAMES = 2 * _NARROW_FRAMES
# Smallest decrease of chi square by an oscillation: it has eight more parameters.
_MIN_OSCILLATION_GAIN = 20.0
# Fourth differences contain noise but no oscillation; their variance over that of the noise.
_FOURTH_DIFFERENCE_VARIANCE = 70.0
# Largest residual of an oscillation: a share of the power of the displacements, or a multiple of
# the noise between frames, since registration errors last for several frames.
_MAX_RESIDUAL_SHARE = 0.02
_MAX_RESIDUAL_NOISE = 3.0
# Error of a velocity over that of independent frames.
_CORRELATION_FACTOR = 2.0
# Frames from one look at the swing of the tray to the next.
_SWING_FRAMES = 10
# Frames on each side over which the temperature is averaged.
_TEMPERATURE_FRAMES = 15


class _Fits:
    """A line and an oscillation through the displacements of some frames.

    Parameters
    ----------
    times : ndarray (frames,), [s]
        From the time of which the velocity is wanted.
    displacements : ndarray (frames, 2), [m]

    Attributes
    ----------
    noise : float, [m]
        Of a component, from frame to frame.
    residual : float, [m]
        Root mean square of a component that the oscillation leaves.
    swings : bool
        Whether the oscillation is seen beside the line.
    is_smooth : bool
        Whether the oscillation leaves little.
    swing : float, [m/s]
        Root mean square of a component of the velocity of the oscillation.
    """

    def __init__(self, times: NDArray[np.float64], displacements: NDArray[np.float64]) -> None:
        differences = np.diff(displacements, 4, axis=0)
        self.noise = float(np.sqrt(np.mean(differences**2) / _FOURTH_DIFFERENCE_VARIANCE))
        self.line = fit_slope(polynomial_terms(times, 1), displacements)
        terms = oscillation_terms(times, displacements)
        self.oscillation = fit_slope(terms, displacements)
        rest = self.oscillation.residual
        self.residual = math.sqrt(rest / (2 * times.size))
        self.swings = self.line.residual - rest >= _MIN_OSCILLATION_GAIN * self.noise**2
        noise_limit = 2 * times.size * (_MAX_RESIDUAL_NOISE * self.noise) ** 2
        self.is_smooth = rest < max(_MAX_RESIDUAL_SHARE * self.line.residual, noise_limit)
        self.swing = swing_speed(times, self.oscillation.fitted)


class TrayHistory:
    """Displacements, velocities and tracks of a tray over the last frames.

    Parameters
    ----------
    frames : int
        Number of frames that are kept.
    """

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self._tracks: deque[Tracks] = deque(maxlen=frames)
        # Buffers of twice the length: the valid half is moved to the front when they are full.
        self._time_buffer = np.empty(2 * frames)
        self._displacement_buffer = np.empty((2 * frames, 2))
        # For each species: sum of the squares of the known velocities, and their number.
        self._square_buffer = np.empty((2 * frames, 0, 2))
        self._end = 0
        self._swing = SwingDecay()
        self._until_swing = _SWING_FRAMES
        self.interval = math.inf

    @property
    def _valid(self) -> slice:
        return slice(max(self._end - self._frames, 0), self._end)

    @property
    def _times(self) -> NDArray[np.float64]:
        return self._time_buffer[self._valid]

    @property
    def _displacements(self) -> NDArray[np.float64]:
        return self._displacement_buffer[self._valid]

    def push(self, time: float, tracks: Tracks) -> None:
        """Add the tracks of the next frame; `time` in s."""
        if self._end == 2 * self._frames:
            for values in (self._time_buffer, self._displacement_buffer, self._square_buffer):
                values[: self._frames] = values[self._frames :]
            self._end = self._frames
        if self._square_buffer.shape[1] != tracks.expected.size:
            self._square_buffer = np.zeros((2 * self._frames, tracks.expected.size, 2))
        end, self._end = self._end, self._end + 1
        self._time_buffer[end] = time
        self._displacement_buffer[end] = tracks.displacement
        self._tracks.append(tracks)
        first = max(end - _TEMPERATURE_FRAMES, self._valid.start)
        times = self._time_buffer[first : self._end]
        squares = self._square_buffer[end]
        self.interval = _frame_statistics(times, tracks.velocities, tracks.species, squares)
        self._until_swing -= 1
        if not self._until_swing:
            self._until_swing = _SWING_FRAMES
            self._watch_swing()

    def _watch_swing(self) -> None:
        """Remember how fast the tray swings in the last frames, where it does."""
        frames = 2 * _WIDE_FRAMES
        times, displacements = self._times[-frames:], self._displacements[-frames:]
        if times.size < frames:
            return
        middle = 0.5 * float(times[0] + times[-1])
        fits = _Fits(times - middle, displacements)
        if fits.swings and fits.is_smooth:
            self._swing.push(middle, fits.swing)

    def _window(self, time: float, frames: int) -> slice:
        middle = int(np.searchsorted(self._times, time))
        return slice(max(middle - frames, 0), middle + frames)

    def velocity(self, time: float) -> tuple[NDArray[np.float64], float]:
        """Velocity of the tray at a time, and the error of a component.

        Returns
        -------
        velocity : ndarray (2,), [m/s]
        error : float, [m/s]
        """
        wide, narrow = self._window(time, _WIDE_FRAMES), self._window(time, _NARROW_FRAMES)
        times = self._times - time
        displacements = self._displacements
        if times[wide].size < _MIN_FRAMES:
            return np.zeros(2), math.inf
        fits = _Fits(times[wide], displacements[wide])
        swing = self._swing.speed(time)
        if not fits.swings:
            # An oscillation below the noise may still be there.
            factor = math.hypot(fits.line.error_factor, 0.5 * fits.oscillation.error_factor)
            return fits.line.velocity, math.hypot(fits.noise * factor, swing)
        if fits.is_smooth:
            velocity = fits.oscillation.velocity
            error = _CORRELATION_FACTOR * max(fits.noise, fits.residual)
            error *= fits.oscillation.error_factor
            unseen = max(swing - fits.swing, 0.0)
            return velocity, math.hypot(error, SWING_ERROR * math.hypot(*velocity), unseen)
        cubic = fit_slope(polynomial_terms(times[narrow], 3), displacements[narrow])
        return cubic.velocity, _CORRELATION_FACTOR * fits.noise * cubic.error_factor

    def displacement(self, time: float) -> tuple[float, float]:
        """Displacement of the tray at a time, [m], with the noise of its registration."""
        return _interpolate(time, self._times, self._displacements)

    def temperature(self, time: float, species: int) -> float:
        """Mean square of a velocity component in the image plane of a species, [m^2/s^2]."""
        squares = self._square_buffer[self._valid][self._window(time, _TEMPERATURE_FRAMES)]
        sums = np.sum(squares[:, species], axis=0)
        return 0.5 * float(sums[0] / sums[1]) if sums[1] else math.nan

    def is_isolated(self, time: float, tracks: list[int], beads: NDArray[np.float64]) -> bool:
        """Whether no other bead can have hit the given beads between the frames around a time.

        Parameters
        ----------
        time : float, [s]
        tracks : list of int
            Track numbers of these beads.
        beads : ndarray (k, 4)
            Position in the camera frame [m], radius [m] and speed [m/s] of each.
        """
        window = self._window(time, 1)
        last = min(window.stop, len(self._tracks))
        return all(
            _none_in_reach(
                np.array(tracks),
                beads,
                record.ids,
                record.positions,
                record.displacement,
                record.velocities,
                record.radii,
                self.interval,
            )
            for record in (self._tracks[k] for k in range(window.start, last))
        )


@compiled
def _none_in_reach(
    tracks: NDArray[np.int64],
    beads: NDArray[np.float64],
    ids: NDArray[np.int32],
    positions: NDArray[np.float64],
    displacement: NDArray[np.float64],
    velocities: NDArray[np.float64],
    radii: NDArray[np.float64],
    interval: float,
) -> bool:
    for k in range(ids.size):
        if (tracks == ids[k]).any():
            continue
        u, v = velocities[k]
        speed = math.sqrt(u * u + v * v)
        if speed != speed:
            speed = 0.0
        for j in range(beads.shape[0]):
            reach = beads[j, 2] + radii[k] + interval * (beads[j, 3] + speed)
            x = positions[k, 0] + displacement[0] - beads[j, 0]
            y = positions[k, 1] + displacement[1] - beads[j, 1]
            if math.sqrt(x * x + y * y) < reach:
                return False
    return True


@compiled
def _interpolate(
    time: float, times: NDArray[np.float64], positions: NDArray[np.float64]
) -> tuple[float, float]:
    """Linear interpolation of positions; constant before the first and after the last."""
    k = int(np.searchsorted(times, time))
    if k == 0 or k == times.size:
        k = min(k, times.size - 1)
        return positions[k, 0], positions[k, 1]
    fraction = (time - times[k - 1]) / (times[k] - times[k - 1])
    x = positions[k - 1, 0] + fraction * (positions[k, 0] - positions[k - 1, 0])
    y = positions[k - 1, 1] + fraction * (positions[k, 1] - positions[k - 1, 1])
    return x, y


@compiled
def _frame_statistics(
    times: NDArray[np.float64],
    velocities: NDArray[np.float64],
    species: NDArray[np.int32],
    sums: NDArray[np.float64],
) -> float:
    """Median time between two frames, [s].

    Writes into `sums`, (species, 2), the sum of the squared velocities of each species and their
    number.
    """
    sums[:] = 0.0
    for k in range(species.size):
        square = velocities[k, 0] * velocities[k, 0] + velocities[k, 1] * velocities[k, 1]
        if square < np.inf:
            sums[species[k], 0] += square
            sums[species[k], 1] += 1.0
    return median_of(times[1:] - times[:-1]) if times.size > 1 else math.inf
