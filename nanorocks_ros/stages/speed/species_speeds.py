"""Mean speeds of the species of a tray, and of all its beads, from images of each species.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from nanorocks_ros.records import NS
from nanorocks_ros.stages.speed.crowded_structure_function import (
    CrowdedGrains,
    CrowdedStructureFunction,
)
from nanorocks_ros.stages.speed.structure_function import StructureFunction
from nanorocks_ros.stages.speed.structure_samples import Sample
from nanorocks_ros.stages.speed.unrelated_pairs import UnrelatedPairs

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SpeedSettings

# Samples held back at most while the beads do not move enough to be known.
_MAX_HELD = 3000


@dataclass(frozen=True, slots=True)
class PictureSpeed:
    """Mean speed of the beads in the picture at one instant.

    Parameters
    ----------
    stamp_ns, window_ns : int, [ns]
        Middle and length of the time between the two images compared, the shortest of all species.
    cycle : int
    cycle_start_ns : int or None
    speed, error : float, [px/s]
        Of all beads.
    species : tuple of (float, float), [px/s]
        Speed and its error for each species.
    in_range : bool
        Whether the displacement of every species can be read reliably.
    """

    stamp_ns: int
    window_ns: int
    cycle: int
    cycle_start_ns: int | None
    speed: float
    error: float
    species: tuple[tuple[float, float], ...]
    in_range: bool


class SpeciesSpeeds:
    """Measures all species about the same instants, once the appearance of their beads is known.

    Parameters
    ----------
    settings : SpeedSettings
    diameters_px : sequence of float, [px]
        Mean diameter of the beads of each species.
    counts : sequence of int
        Beads of each species.
    factors : sequence of (float, float)
        Factor for the speed of each species, and its error.
    crowd : CrowdedGrains, optional
        Of grains that hide and hit each other.
    """

    def __init__(
        self,
        settings: SpeedSettings,
        diameters_px: Sequence[float],
        counts: Sequence[int],
        factors: Sequence[tuple[float, float]],
        crowd: CrowdedGrains | None = None,
    ) -> None:
        self._counts = tuple(counts)
        self._factors = tuple(factors)
        self._parts = [
            StructureFunction(settings, diameter, count, centred=len(self._counts) > 1)
            if crowd is None
            else CrowdedStructureFunction(settings, diameter, count, crowd)
            for diameter, count in zip(diameters_px, counts, strict=True)
        ]
        self._held: list[tuple[Sample, ...]] = []
        self._last_emitted_ns: int | None = None

    def shaken(self) -> None:
        """Forget the images from before a shaking event, all but the last."""
        for part in self._parts:
            part.shaken()

    @property
    def calibrated(self) -> bool:
        """Whether nothing more is to be learnt of the look of the beads."""
        return all(part.calibrated for part in self._parts)

    def unrelated_pairs(self) -> list[UnrelatedPairs]:
        """For each species, what keeps images until two of them are unrelated."""
        return [UnrelatedPairs(part.unrelated_px) for part in self._parts]

    def learn(
        self,
        pairs: Sequence[UnrelatedPairs],
        images: Sequence[NDArray[np.uint8]],
        noise_powers: Sequence[float],
    ) -> None:
        """Learn the look of the beads from images of each species, whose paths the pairs know."""
        for part, kept, image, noise in zip(self._parts, pairs, images, noise_powers, strict=True):
            pair = kept.push(image)
            if pair is not None:
                part.learn(image, pair[0], noise, pair[1])

    def push(
        self,
        stamp_ns: int,
        images: Sequence[NDArray[np.uint8]],
        cycle: tuple[int, int | None],
        noise_powers: Sequence[float],
        shift_px: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[PictureSpeed, ...]:
        """Take the next image of each species.

        Parameters
        ----------
        stamp_ns : int, [ns]
        images : sequence of ndarray of uint8, (rows, columns)
        cycle : tuple
            The cycle, and the stamp at which it started.
        noise_powers : sequence of float, [gray levels^2]
            Mean squared difference per pixel of a scene at rest, for each.
        shift_px : tuple of 2 floats, [px]
            By which the tray had left its place when the images were moved back.

        Returns
        -------
        tuple of PictureSpeed
            In order of time; empty between two samples.
        """
        samples = tuple(
            sample
            for part, image, noise in zip(self._parts, images, noise_powers, strict=True)
            if (sample := part.push(stamp_ns, image, cycle, noise, shift_px)) is not None
        )
        if len(samples) != len(self._parts):
            return ()
        self._held.append(samples)
        del self._held[:-_MAX_HELD]
        if not all(part.ready for part in self._parts):
            return ()
        return self._released()

    def flush(self) -> tuple[PictureSpeed, ...]:
        """The speeds held back at the end of the recording, which are not reliable.

        Empty when too few image pairs have been seen to measure any speed.
        """
        if not all(part.measurable for part in self._parts):
            return ()
        return tuple(replace(speed, in_range=False) for speed in self._released())

    def _released(self) -> tuple[PictureSpeed, ...]:
        held, self._held = self._held, []
        speeds = []
        for speed in map(self._speed, held):
            if self._last_emitted_ns is None or speed.stamp_ns > self._last_emitted_ns:
                self._last_emitted_ns = speed.stamp_ns
                speeds.append(speed)
        return tuple(speeds)

    def _speed(self, samples: tuple[Sample, ...]) -> PictureSpeed:
        lags = [
            part.longest_lag(sample) for part, sample in zip(self._parts, samples, strict=True)
        ]
        windows = [int(sample.windows_ns[lag]) for sample, lag in zip(samples, lags, strict=True)]
        species = []
        for part, sample, lag, window, factor in zip(
            self._parts, samples, lags, windows, self._factors, strict=True
        ):
            path, error = part.displacement(sample, lag)
            speed = path * NS / window
            error = math.hypot(factor[0] * error * NS / window, factor[1] * speed)
            species.append((factor[0] * speed, error))
        shares = [count / sum(self._counts) for count in self._counts]
        fastest = windows.index(min(windows))
        return PictureSpeed(
            stamp_ns=int(samples[fastest].middles_ns[lags[fastest]]),
            window_ns=windows[fastest],
            cycle=samples[0].cycle,
            cycle_start_ns=samples[0].cycle_start_ns,
            speed=sum(share * speed for share, (speed, _) in zip(shares, species, strict=True)),
            error=math.hypot(
                *(share * error for share, (_, error) in zip(shares, species, strict=True))
            ),
            species=tuple(species),
            in_range=all(
                part.in_range(sample, lag)
                for part, sample, lag in zip(self._parts, samples, lags, strict=True)
            ),
        )
