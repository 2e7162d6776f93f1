"""Mean projected speed from the structure function, for each species that a colour tells apart.

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import NS, Measured, Quality, SpeedEstimate, SpeedMethod, TrayImage
from nanorocks_ros.stages.preprocess.shaking.difference_noise import NoiseMeter
from nanorocks_ros.stages.speed.crowded_structure_function import CrowdedGrains
from nanorocks_ros.stages.speed.species_images import SpeciesImages
from nanorocks_ros.stages.speed.species_speeds import PictureSpeed, SpeciesSpeeds

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Species, Tray
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.stages.speed.unrelated_pairs import UnrelatedPairs

# Relative error of the mean speed of a mixture measured as one species: fast light beads count too
# little.
_UNKNOWN_MIXTURE = 0.25
# Relative error of a speed of crowded grains above which it is flagged: some speeds in films of
# drawn cameras are wrong by more than 10 %, and their stated error is not larger.
_CROWDED_ERROR = 0.1
# Pictures that do not show every species, after which all beads are measured together; and
# pictures without colour in a row, after which colour is given up.
_PATIENCE = 30
# While another method measures, the noise is measured between two of so many pictures.
_WATCHED = 10


class StructureSpeed:
    """Measures the speed by the structure function, once the appearance of the beads is known.

    The species of a mixture are separated by colour where possible: the light beads are the fast
    ones, and together each bead counts by its area and contrast.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    crowded : bool
        Whether a species has too many grains to be tracked.
    """

    def __init__(self, settings: PipelineSettings, tray: Tray, *, crowded: bool = False) -> None:
        self._settings = settings.speed
        self._scale = settings.preprocess.pixels_per_metre
        self._tray = tray
        self._crowd = CrowdedGrains.of_tray(tray, self._scale) if crowded else None
        self.reset()

    def reset(self, stamp_ns: int | None = None) -> None:
        """Start afresh."""
        del stamp_ns
        self._watched = 0
        self._idle = False
        self._cycle: int | None = None
        self._flags = Quality(0)
        self._forget_beads()

    def _forget_beads(self) -> None:
        self._images = SpeciesImages(self._tray, self._scale)
        self._separated = False
        self._waited = 0
        self._noise: list[NoiseMeter] = []
        self._noise_powers: list[float] = []
        self._speeds: SpeciesSpeeds | None = None
        self._pairs: list[UnrelatedPairs] = []
        self._watched_ns: int | None = None

    def push(self, image: TrayImage) -> tuple[SpeedEstimate, ...]:
        """Take the next image, whose cycle is known.

        An image without colour is left out where there was colour before.
        """
        self._flags |= image.quality
        shaken = self._cycle not in (None, image.cycle)
        self._cycle = image.cycle
        # The images before a time without images are of no use.
        if self._speeds is not None and (shaken or self._idle):
            self._speeds.shaken()
        self._idle = False
        shown = self._shown(image)
        if not shown or self._speeds is None:
            return ()
        across, down = (
            0.0 if math.isnan(component) else self._scale * component
            for component in image.displacement
        )
        cycle = (image.cycle or 0, image.cycle_start_ns)
        noise = [meter.push(gray) for meter, gray in zip(self._noise, shown, strict=True)]
        return self._estimates(
            self._speeds.push(image.stamp_ns, shown, cycle, noise, (across, down))
        )

    def pause(self) -> None:
        """Release the images while another method measures."""
        if not self._idle and self._speeds is not None:
            self._speeds.shaken()
        self._idle = True

    def watch(self, image: TrayImage, tracked: SpeedEstimate | None) -> None:
        """Learn noise and look of the beads while another method measures, for when it fails.

        Parameters
        ----------
        image : TrayImage
        tracked : SpeedEstimate or None
            Last speeds of this cycle from tracks that are reliable.
        """
        shown: tuple[NDArray[np.uint8], ...] = ()
        self._watched = (self._watched + 1) % _WATCHED
        if self._watched <= 1:
            shown = self._shown(image)
            self._watch_noise(shown)
        if self._is_needed(image.stamp_ns, tracked) and self._speeds is not None:
            shown = shown or self._shown(image)
            if shown and self._noise_powers:
                copies = [gray.copy() for gray in shown]
                self._speeds.learn(self._pairs, copies, self._noise_powers)

    def _watch_noise(self, shown: Sequence[NDArray[np.uint8]]) -> None:
        """Measure the noise between two images of `_WATCHED`."""
        if self._watched == 0:
            for meter, gray in zip(self._noise, shown, strict=False):
                meter.start_from(gray)
        elif shown:
            self._noise_powers = [
                meter.push(gray) for meter, gray in zip(self._noise, shown, strict=True)
            ]

    def _is_needed(self, stamp_ns: int, tracked: SpeedEstimate | None) -> bool:
        """Whether something is to be learnt from this image, by the paths of the beads."""
        last_ns, self._watched_ns = self._watched_ns, stamp_ns
        if self._speeds is None or self._speeds.calibrated or tracked is None:
            self._pairs = []
            return False
        speeds = tracked.species_speeds if self._separated else (tracked.mean_projected_speed,)
        self._pairs = self._pairs or self._speeds.unrelated_pairs()
        if last_ns is None or len(speeds) != len(self._pairs):
            return False
        seconds = (stamp_ns - last_ns) / NS
        paths = [np.nan_to_num(speed.value) * self._scale * seconds for speed in speeds]
        due = [pairs.move(path) for pairs, path in zip(self._pairs, paths, strict=True)]
        return all(due)

    def flush(self) -> tuple[SpeedEstimate, ...]:
        """Speeds held back in a recording too short to know the beads, flagged as uncertain."""
        return self._estimates(self._speeds.flush()) if self._speeds is not None else ()

    def _shown(self, image: TrayImage) -> tuple[NDArray[np.uint8], ...]:
        """An image of each species, or one of all beads; none while that is not decided."""
        if self._speeds is None and not self._learn_beads(image):
            return ()
        if not self._separated:
            return (image.gray,)
        if image.color is not None:
            self._waited = 0
            return self._species_images(image, image.color)
        self._flags |= Quality.GRAY_CAMERA
        self._waited += 1
        if self._waited > _PATIENCE:
            self._forget_beads()
        return ()

    def _species_images(
        self, image: TrayImage, color: NDArray[np.uint8]
    ) -> tuple[NDArray[np.uint8], ...]:
        """An image of each species; grains that cover the tray are nearly all of its gray image.

        Colours in steps, and those of a codec, change as grains move: speeds from images of the
        grains alone were 5 % higher.
        """
        shown = self._images.images(color)
        if self._crowd is None:
            return shown
        return tuple(
            species_image if species.properties.hue else image.gray
            for species, species_image in zip(self._tray.species, shown, strict=True)
        )

    def _learn_beads(self, image: TrayImage) -> bool:
        """Decide whether the species are separated; False until the picture shows it."""
        tray = self._tray
        separated = image.color is not None and self._images.possible
        if separated and image.color is not None and not self._images.learn(image.color):
            self._waited += 1
            if self._waited <= _PATIENCE:
                return False
            separated = False
        if separated or len(tray.species) == 1:
            diameters = [species.diameter * self._scale for species in tray.species]
            counts = [species.count for species in tray.species]
            factors = [size_factor(species) for species in tray.species]
        else:
            diameters, counts = [tray.diameter * self._scale], [tray.count]
            factors = [(1.0, _UNKNOWN_MIXTURE)]
        self._separated = separated
        self._waited = 0
        self._noise = [NoiseMeter() for _ in diameters]
        self._speeds = SpeciesSpeeds(self._settings, diameters, counts, factors, self._crowd)
        return True

    def _estimates(self, speeds: tuple[PictureSpeed, ...]) -> tuple[SpeedEstimate, ...]:
        estimates = tuple(self._estimate(speed) for speed in speeds)
        if estimates:
            self._flags = Quality(0)
        return estimates

    def _estimate(self, speed: PictureSpeed) -> SpeedEstimate:
        scale = self._scale
        species = speed.species if self._separated else ()
        rough = self._crowd is not None and speed.error > _CROWDED_ERROR * abs(speed.speed)
        uncertain = Quality.UNCERTAIN if rough or not speed.in_range else Quality(0)
        return SpeedEstimate(
            stamp_ns=speed.stamp_ns,
            tray=self._tray.number,
            cycle=speed.cycle,
            cycle_start_ns=speed.cycle_start_ns,
            mean_projected_speed=Measured(speed.speed / scale, speed.error / scale),
            window=speed.window_ns / NS,
            method=SpeedMethod.STRUCTURE_FUNCTION,
            quality=self._flags | uncertain,
            species_speeds=tuple(
                Measured(value / scale, error / scale) for value, error in species[:2]
            ),
        )


def size_factor(species: Species) -> tuple[float, float]:
    """Factor for the speed of a species with a range of sizes, and its error.

    The squared difference of two images grows with the outline of a bead times its path, so it
    gives <R v> / <R>. That is the mean speed when all beads are equally fast; when all have the
    same energy, v goes as R^-3/2 and the mean speed is larger. The factor is half way between, its
    error half the difference.

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
