"""Mean projected speed from the structure function of the tray image.

S(L), the sum of the squared differences of two images L apart in time less that of the noise,
grows with the mean displacement of the beads in that time. The largest lag still well below the
plateau is used, and the curve that turns S into a displacement is learnt from the same recording
(:mod:`nanorocks_ros.stages.speed.structure_calibration`).

Tested by ``test/pipeline/test_tray_measurement.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.records import NS
from nanorocks_ros.stages.preprocess.shaking.difference_noise import difference_power
from nanorocks_ros.stages.speed.structure_calibration import StructureCalibration
from nanorocks_ros.stages.speed.structure_samples import ImagePair, Sample, lag_ladder

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SpeedSettings

# Path, in bead diameters, after which two images are taken to be unrelated, but for a share that
# is corrected for; and the number of such pairs needed before speeds are released.
_UNRELATED_PATH = 4.0
_PAIRS_NEEDED = 6
# Fewer leave the spread of the response unknown; used for speeds that are flagged.
_PAIRS_MEASURABLE = 2
# A bead deflected between two images has come further than it is away. Share of the path lost
# per path of one diameter, and variance of that loss for one bead per unit of it: measured on
# simulated gases in tray 1; the rates of deflection per diameter in trays 3 and 5 are alike.
_DEFLECTION_LOSS = 0.25
_DEFLECTION_SCATTER = 0.75
# Share of that loss that differs from one gas to another; and share of the motion of the tray that
# may be left when it is subtracted.
_DEFLECTION_ERROR = 0.3
_SHIFT_ERROR = 0.5
# Share of the plateau beyond which a displacement is not reliable: a sixth of the simulated
# estimates were off by more than 20 %.
_OUT_OF_RANGE = 0.65
_KEY_INTERVAL_NS = NS // 4
_KEYS_KEPT = 48


class StructureFunction:
    """Turns images of one species into mean displacements, once it is calibrated.

    Parameters
    ----------
    settings : SpeedSettings
    diameter_px : float, [px]
        Mean bead diameter.
    beads : int
    centred : bool
        Whether all pairs of images have the same middle, so that species of different speeds can
        have different lags; otherwise all pairs end with the last image, half the longest lag
        earlier.
    layers : float, >= 0
        Number of grains above one another, where they hide each other; 0 where they do not.
    """

    # Pairs of images from which the calibration is learnt: the first ones, from the fast gas. Of
    # slow beads in crowds many keep their places, and the plateau seems lower.
    _pairs_kept = 24

    def __init__(
        self,
        settings: SpeedSettings,
        diameter_px: float,
        beads: int,
        *,
        centred: bool = False,
        layers: float = 0.0,
    ) -> None:
        self._settings = settings
        self._saturation = settings.saturation
        self._layers = layers
        self._centred = centred
        self._diameter_px = diameter_px
        self._lags = lag_ladder(settings.max_lag_frames)
        self._images: deque[tuple[int, NDArray[np.uint8]]] = deque(
            maxlen=settings.max_lag_frames + 1
        )
        self._shifts: deque[tuple[float, float]] = deque(maxlen=settings.max_lag_frames + 1)
        self._keys: list[tuple[int, NDArray[np.uint8]]] = []
        self._key_interval_ns = _KEY_INTERVAL_NS
        self._response = StructureCalibration(diameter_px, beads, layers)
        self._first_guess = StructureCalibration(diameter_px, beads, layers)
        self._unrelated_px = _UNRELATED_PATH * diameter_px
        self._beads = beads
        self._path_stamps: list[int] = []
        self._path: list[float] = []
        self._next_sample_ns: int | None = None

    def shaken(self) -> None:
        """Forget the images from before a shaking event, all but the last."""
        if not self._images:
            return
        last, shift = self._images[-1], self._shifts[-1]
        self._images.clear()
        self._images.append(last)
        self._shifts.clear()
        self._shifts.append(shift)
        self._keys.clear()
        self._key_interval_ns = _KEY_INTERVAL_NS
        self._path_stamps.clear()
        self._path.clear()
        self._next_sample_ns = None

    def push(
        self,
        stamp_ns: int,
        gray: NDArray[np.uint8],
        cycle: tuple[int, int | None],
        noise_power: float,
        shift_px: tuple[float, float] = (0.0, 0.0),
    ) -> Sample | None:
        """Take the next image; a sample when one is due.

        Parameters
        ----------
        stamp_ns : int, [ns]
        gray : ndarray of uint8, (rows, columns)
        cycle : tuple
            The cycle, and the stamp at which it started.
        noise_power : float, [gray levels^2]
            Mean squared difference per pixel of a scene at rest.
        shift_px : tuple of 2 floats, [px]
            By which the tray had left its place when the image was moved back.
        """
        self._images.append((stamp_ns, gray))
        self._shifts.append(shift_px)
        if self._next_sample_ns is None:
            self._next_sample_ns = stamp_ns
        sample = None
        if stamp_ns >= self._next_sample_ns and len(self._images) > 1:
            self._next_sample_ns += round(self._settings.interval * NS)
            self._next_sample_ns = max(self._next_sample_ns, stamp_ns + 1)
            sample = self._sample(cycle, noise_power, self._centred)
        if self.calibrated:
            self._keys.clear()
        elif not self._keys or stamp_ns - self._keys[-1][0] >= self._key_interval_ns:
            self._learn(stamp_ns, gray, noise_power)
            self._keep_key(stamp_ns, gray)
        return sample

    def learn(
        self,
        later: NDArray[np.uint8],
        earlier: NDArray[np.uint8],
        noise_power: float,
        path_px: float,
    ) -> None:
        """Learn the look of the beads from two images with a path of them that is known.

        Parameters
        ----------
        later, earlier : ndarray of uint8, (rows, columns)
        noise_power : float, [gray levels^2]
            Mean squared difference per pixel of a scene at rest.
        path_px : float, [px]
            Mean path of the beads, at least `unrelated_px`.
        """
        self._response.add(later, earlier, noise_power, self._displacement_of(path_px))

    @property
    def unrelated_px(self) -> float:
        """Mean path of the beads after which two images are unrelated, [px]."""
        return self._unrelated_px

    @property
    def calibrated(self) -> bool:
        """Whether nothing more is to be learnt."""
        return self._response.pairs >= self._pairs_kept

    @property
    def ready(self) -> bool:
        """Whether enough unrelated image pairs have been seen."""
        return self._response.pairs >= _PAIRS_NEEDED

    @property
    def measurable(self) -> bool:
        """Whether displacements can be measured at all, if not reliably."""
        return self._response.pairs >= _PAIRS_MEASURABLE

    def _sample(
        self, cycle: tuple[int, int | None], noise_power: float, centred: bool = False
    ) -> Sample:
        lags = [lag for lag in self._lags if lag < len(self._images)]
        last = len(self._images) - 1
        # The later of the two images: the last one, or the one that gives all pairs one middle.
        ends = [last - (last - lag) // 2 if centred else last for lag in lags]
        pairs = [
            (self._images[end], self._images[end - lag])
            for end, lag in zip(ends, lags, strict=True)
        ]
        shifts = np.array(
            [
                (self._shifts[end], self._shifts[end - lag])
                for end, lag in zip(ends, lags, strict=True)
            ]
        ).reshape(-1, 2, 2)
        powers, shifts_px = self._differences(pairs, shifts[:, 0] - shifts[:, 1])
        return Sample(
            cycle=cycle[0],
            cycle_start_ns=cycle[1],
            noise_power=noise_power,
            middles_ns=np.array([(later[0] + earlier[0]) // 2 for later, earlier in pairs]),
            windows_ns=np.array([later[0] - earlier[0] for later, earlier in pairs]),
            shifts_px=shifts_px,
            tray_px=np.hypot(*(shifts[:, 0] - shifts[:, 1]).T),
            powers=powers - noise_power * self._images[-1][1].size,
        )

    def _differences(
        self, pairs: list[ImagePair], shifts: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Squared differences of pairs of images, and how far the tray moved past the beads."""
        powers = [difference_power(later[1], earlier[1]) for later, earlier in pairs]
        return np.array(powers), np.hypot(*shifts.T)

    def longest_lag(self, sample: Sample) -> int:
        """Index of the longest lag over which the displacement can be read."""
        return self._lag_below_plateau(sample, self._response)

    def displacement(self, sample: Sample, lag: int) -> tuple[float, float]:
        """Mean path of the beads over a lag, and its error, [px].

        Parameters
        ----------
        sample : Sample
        lag : int
            Index in `sample.windows_ns`.
        """
        power = sample.powers[lag : lag + 1]
        pixels = self._images[-1][1].size
        apparent = float(self._response.displacement(power)[0])
        error = float(self._response.displacement_error(power, sample.noise_power, pixels)[0])
        # Beads move past the camera, and the images follow the tray: so grows the mean of Rayleigh
        # distributed distances when all beads are shifted.
        square = apparent**2 - 0.25 * np.pi * float(sample.shifts_px[lag]) ** 2
        if square > 0.0:
            error *= apparent / np.sqrt(square)
        left = float(np.sqrt(max(square, 0.0)))
        loss = min(0.5, _DEFLECTION_LOSS * left / self._diameter_px)
        scatter = np.sqrt(_DEFLECTION_SCATTER * loss / self._beads) * left
        systematic = (_DEFLECTION_ERROR * loss * left, _SHIFT_ERROR * (apparent - left))
        return left / (1.0 - loss), math.hypot(error, scatter, *systematic)

    def in_range(self, sample: Sample, lag: int) -> bool:
        """Whether the displacement over a lag can be read reliably."""
        return bool(sample.powers[lag] <= _OUT_OF_RANGE * self._response.plateau)

    def _lag_below_plateau(self, sample: Sample, response: StructureCalibration) -> int:
        low_enough = sample.powers <= self._saturation * response.plateau
        # Up to the first lag that is too long: a later one may return below it by chance.
        return max(0, int(np.argmin(np.append(low_enough, False))) - 1)

    def _learn(self, stamp_ns: int, gray: NDArray[np.uint8], noise_power: float) -> None:
        if not self._keys:
            return
        if not self.ready:
            self._guess_response(gray, noise_power)
        self._extend_path(stamp_ns, noise_power)
        path_now = self._path[-1]
        for key_stamp, key in self._keys:
            path = path_now - float(np.interp(key_stamp, self._path_stamps, self._path))
            displacement = self._displacement_of(path)
            if displacement >= self._unrelated_px:
                self._response.add(gray, key, noise_power, displacement)
                return

    def _displacement_of(self, path_px: float) -> float:
        """Mean displacement of the beads after a path, [px]."""
        return path_px

    def _keep_key(self, stamp_ns: int, gray: NDArray[np.uint8]) -> None:
        self._keys.append((stamp_ns, gray))
        if len(self._keys) > _KEYS_KEPT:
            # Slow beads need images further apart: keep every other one.
            del self._keys[1::2]
            self._key_interval_ns *= 2

    def _guess_response(self, gray: NDArray[np.uint8], noise_power: float) -> None:
        """A response from the two images furthest apart, until there is a better one."""
        self._first_guess = StructureCalibration(self._diameter_px, self._beads, self._layers)
        self._first_guess.add(gray, self._keys[0][1], noise_power)

    def _extend_path(self, stamp_ns: int, noise_power: float) -> None:
        """Extend the mean path of a bead since the shaking event, [px]."""
        if not self._path:
            self._path_stamps.append(self._keys[-1][0])
            self._path.append(0.0)
        step = 0.0
        response = self._response if self.ready else self._first_guess
        # Without motion the guess is made of noise alone.
        if response.plateau > noise_power * self._images[-1][1].size:
            sample = self._sample((0, None), noise_power)
            lag = self._lag_below_plateau(sample, response)
            pixels = float(response.displacement(sample.powers[lag : lag + 1])[0])
            step = pixels * (stamp_ns - self._path_stamps[-1]) / float(sample.windows_ns[lag])
        self._path_stamps.append(stamp_ns)
        self._path.append(self._path[-1] + step)
