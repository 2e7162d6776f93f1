"""Mean projected speed from the structure function, for each species that a colour tells apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.records import Quality, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.stages.mean_motion import MeanMotion, MeanMotions
from nanorocks_ros.stages.shaking import NS, CycleFollower, NoiseMeter
from nanorocks_ros.stages.species_images import SpeciesImages

if TYPE_CHECKING:
    from nanorocks_ros.experiment.settings import PipelineSettings
    from nanorocks_ros.experiment.trays import Species, Tray

# Relative error of the mean speed of a mixture seen as one: fast light beads count too little.
_UNKNOWN_MIXTURE = 0.25


class StructureSpeed:
    """Measures the speed by the structure function; silent until it knows the beads.

    A mixture is told apart by colour where there is one: the light beads of a mixture are the
    fast ones, and a bead counts by its area and contrast when all are seen as one.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._settings = settings.speed
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self._images = SpeciesImages(tray, self._scale)
        self._noise: list[NoiseMeter] = []
        self._motions: MeanMotions | None = None
        self._flags = Quality(0)

    def push(
        self, image: TrayImage, shakes: CycleFollower, shaken: bool
    ) -> tuple[SpeedEstimate, ...]:
        """Take the next image."""
        if self._motions is None and not self._begin(image):
            return ()
        assert self._motions is not None
        if shaken:
            self._motions.shaken()
        self._flags |= image.quality
        cycle = (shakes.cycle, shakes.cycle_start_ns)
        across, down = (
            0.0 if math.isnan(one) else self._scale * one for one in image.displacement
        )
        shift = (across, down)
        if self._noise:
            assert image.color is not None
            images = self._images.of(image.color)
            noise = [meter.push(one) for meter, one in zip(self._noise, images, strict=True)]
            found = self._motions.push(image.stamp_ns, images, cycle, noise, shift)
        else:
            found = self._motions.push(
                image.stamp_ns, (image.gray,), cycle, (shakes.noise_power,), shift
            )
        if not found:
            return ()
        estimates = tuple(self._estimate(one) for one in found)
        self._flags = Quality(0)
        return estimates

    def _begin(self, image: TrayImage) -> bool:
        """Decide whether species are told apart; False until the picture shows it."""
        tray = self._tray
        told_apart = image.color is not None and self._images.possible
        if told_apart and image.color is not None and not self._images.learn(image.color):
            return False
        if told_apart or len(tray.species) == 1:
            diameters = [one.diameter * self._scale for one in tray.species]
            counts = [one.count for one in tray.species]
            factors = [size_factor(one) for one in tray.species]
        else:
            diameters, counts = [tray.diameter * self._scale], [tray.count]
            factors = [(1.0, _UNKNOWN_MIXTURE)]
        self._noise = [NoiseMeter() for _ in tray.species] if told_apart else []
        self._motions = MeanMotions(self._settings, diameters, counts, factors)
        return True

    def _estimate(self, motion: MeanMotion) -> SpeedEstimate:
        scale = self._scale
        known = motion.species if self._noise else ()
        return SpeedEstimate(
            stamp_ns=motion.stamp_ns,
            tray=self._tray.number,
            cycle=motion.cycle,
            cycle_start_ns=motion.cycle_start_ns,
            mean_projected_speed=motion.speed / scale,
            mean_projected_speed_error=motion.error / scale,
            window=motion.window_ns / NS,
            method=SpeedMethod.STRUCTURE_FUNCTION,
            quality=self._flags,
            **SpeedEstimate.by_species([(speed / scale, error / scale) for speed, error in known]),
        )


def size_factor(species: Species) -> tuple[float, float]:
    """What a spread of sizes asks of the speed of a species: a factor, and its error.

    The squared difference of two images grows with the outline of a bead times its path, so it
    tells <R v> / <R>. That is the mean speed when all are as fast; when all have the same energy,
    v goes as R^-3/2 and the mean speed is more. Half way between, with half the difference as
    the error.

    Parameters
    ----------
    species : Species
        Diameters evenly spread over the range.
    """
    low, high = species.diameter_low, species.diameter_high
    if low == high:
        return 1.0, 0.0
    width = high - low
    weighted = 2.0 * (math.sqrt(high) - math.sqrt(low)) / width
    speed = 2.0 * (1.0 / math.sqrt(low) - 1.0 / math.sqrt(high)) / width
    excess = species.diameter * speed / weighted - 1.0
    return 1.0 + 0.5 * excess, 0.5 * excess
