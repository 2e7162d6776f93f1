"""Mean projected speed from the structure function, for each species that a colour tells apart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nanorocks_ros.records import (
    Measured,
    Quality,
    SpeedEstimate,
    SpeedMethod,
    TrayImage,
)
from nanorocks_ros.stages.preprocess.shake_detection import NS, CycleFollower, NoiseMeter
from nanorocks_ros.stages.speed.species_images import SpeciesImages
from nanorocks_ros.stages.speed.species_speeds import MeanMotion, MeanMotions

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import PipelineSettings

# Relative error of the mean speed of a mixture seen as one: fast light beads count too little.
_UNKNOWN_MIXTURE = 0.25
# Pictures that do not show every species, after which all beads are seen as one; and pictures
# without colour in a row, after which one need not wait for it.
_PATIENCE = 30
# While others measure, two of so many pictures are looked at for the noise.
_WATCHED = 10


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
        self._watched = 0
        self._flags = Quality(0)
        self._restart()

    def _restart(self) -> None:
        self._images = SpeciesImages(self._tray, self._scale)
        self._told_apart = False
        self._waited = 0
        self._noise: list[NoiseMeter] = []
        self._motions: MeanMotions | None = None

    def push(
        self, image: TrayImage, shakes: CycleFollower, shaken: bool
    ) -> tuple[SpeedEstimate, ...]:
        """Take the next image; one without colour, where there was colour before, is left out."""
        self._flags |= image.quality
        if self._motions is not None and shaken:
            self._motions.shaken()
        shown = self._shown(image)
        if not shown or self._motions is None:
            return ()
        cycle = (shakes.cycle, shakes.cycle_start_ns)
        across, down = (
            0.0 if math.isnan(one) else self._scale * one for one in image.displacement
        )
        shift = (across, down)
        noise = [meter.push(one) for meter, one in zip(self._noise, shown, strict=True)]
        motions = self._motions.push(image.stamp_ns, shown, cycle, noise, shift)
        if not motions:
            return ()
        estimates = tuple(self._estimate(motion) for motion in motions)
        self._flags = Quality(0)
        return estimates

    def rest(self) -> None:
        """Hold no images while there is no use for them."""
        if self._motions is not None:
            self._motions.shaken()

    def watch(self, image: TrayImage) -> None:
        """See no more of an image than what the noise is, for when it will be needed."""
        self._watched = (self._watched + 1) % _WATCHED
        if self._watched > 1:
            return
        for meter, one in zip(self._noise, self._shown(image), strict=False):
            if self._watched == 0:
                meter.begin(one)
            else:
                meter.push(one)

    def _shown(self, image: TrayImage) -> tuple[NDArray[np.uint8], ...]:
        """An image of each species, or one of all; none while that is not decided."""
        if self._motions is None and not self._begin(image):
            return ()
        if not self._told_apart:
            return (image.gray,)
        if image.color is not None:
            self._waited = 0
            return self._images.of(image.color)
        self._flags |= Quality.GRAY_CAMERA
        self._waited += 1
        if self._waited > _PATIENCE:
            self._restart()
        return ()

    def _begin(self, image: TrayImage) -> bool:
        """Decide whether species are told apart; False until the picture shows it."""
        tray = self._tray
        told_apart = image.color is not None and self._images.possible
        if told_apart and image.color is not None and not self._images.learn(image.color):
            self._waited += 1
            if self._waited <= _PATIENCE:
                return False
            told_apart = False
        if told_apart or len(tray.species) == 1:
            diameters = [one.diameter * self._scale for one in tray.species]
            counts = [one.count for one in tray.species]
            factors = [size_factor(one) for one in tray.species]
        else:
            diameters, counts = [tray.diameter * self._scale], [tray.count]
            factors = [(1.0, _UNKNOWN_MIXTURE)]
        self._told_apart = told_apart
        self._waited = 0
        self._noise = [NoiseMeter() for _ in diameters]
        self._motions = MeanMotions(self._settings, diameters, counts, factors)
        return True

    def _estimate(self, motion: MeanMotion) -> SpeedEstimate:
        scale = self._scale
        known = motion.species if self._told_apart else ()
        out_of_range = Quality(0) if motion.in_range else Quality.UNCERTAIN
        return SpeedEstimate(
            stamp_ns=motion.stamp_ns,
            tray=self._tray.number,
            cycle=motion.cycle,
            cycle_start_ns=motion.cycle_start_ns,
            mean_projected_speed=Measured(motion.speed / scale, motion.error / scale),
            window=motion.window_ns / NS,
            method=SpeedMethod.STRUCTURE_FUNCTION,
            quality=self._flags | out_of_range,
            species_speeds=tuple(
                Measured(speed / scale, error / scale) for speed, error in known[:2]
            ),
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
