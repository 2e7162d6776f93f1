"""Mean projected speed from the structure function of the tray image.

S(L), the sum of the squared differences of two images L apart in time less what noise alone
gives, grows with the mean displacement of the beads in that time. The largest lag still well
below the plateau is used, and the curve that turns S into a displacement is learnt from the
same recording (:mod:`nanorocks_ros.stages.bead_response`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.stages.bead_response import BeadResponse
from nanorocks_ros.stages.shaking import NS, difference_power

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.experiment.settings import SpeedSettings

# Path, in bead diameters, after which two images are taken to be unrelated but for a share
# that is made up for; and how many such pairs are needed before speeds are released.
_UNRELATED_PATH = 4.0
_PAIRS_NEEDED = 6
# A bead deflected between two images has come further than it is away. Share of the path lost
# per path of one diameter, and variance of that loss for one bead per unit of it: measured on
# simulated gases in tray 1; the rates of deflection per diameter in trays 3 and 5 are alike.
_DEFLECTION_LOSS = 0.25
_DEFLECTION_SCATTER = 0.75
_PAIRS_KEPT = 400
_KEY_INTERVAL_NS = NS // 4
_KEYS_KEPT = 48


@dataclass(frozen=True, slots=True)
class Displacement:
    """Mean path of the beads between two images.

    Parameters
    ----------
    stamp_ns, window_ns : int
        Middle and length of the time between the two.
    cycle : int
    cycle_start_ns : int or None
    pixels, pixels_error : float, [px]
    """

    stamp_ns: int
    window_ns: int
    cycle: int
    cycle_start_ns: int | None
    pixels: float
    pixels_error: float


@dataclass(frozen=True, slots=True)
class _Sample:
    """Structure function at every lag, at one instant."""

    stamp_ns: int
    cycle: int
    cycle_start_ns: int | None
    noise_power: float
    windows_ns: NDArray[np.int64]
    powers: NDArray[np.float64]


class StructureFunction:
    """Turns gray images into mean displacements; silent until it knows its beads.

    Parameters
    ----------
    settings : SpeedSettings
    diameter_px : float, [px]
        Mean bead diameter.
    beads : int
    """

    def __init__(self, settings: SpeedSettings, diameter_px: float, beads: int) -> None:
        self._settings = settings
        self._diameter_px = diameter_px
        self._lags = _ladder(settings.longest_lag_frames)
        self._images: deque[tuple[int, NDArray[np.uint8]]] = deque(
            maxlen=settings.longest_lag_frames + 1
        )
        self._keys: list[tuple[int, NDArray[np.uint8]]] = []
        self._key_interval_ns = _KEY_INTERVAL_NS
        self._response = BeadResponse(diameter_px, beads)
        self._first_guess = BeadResponse(diameter_px, beads)
        self._beads = beads
        self._held: list[_Sample] = []
        self._path_stamps: list[int] = []
        self._path: list[float] = []
        self._next_sample_ns: int | None = None
        self._last_emitted_ns: int | None = None

    def shaken(self) -> None:
        """Forget the images from before a shaking event, all but the last."""
        last = self._images[-1]
        self._images.clear()
        self._images.append(last)
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
    ) -> tuple[Displacement, ...]:
        """Take the next image; `cycle` is the cycle and the stamp at which it started."""
        self._images.append((stamp_ns, gray))
        if self._next_sample_ns is None:
            self._next_sample_ns = stamp_ns
        found: tuple[Displacement, ...] = ()
        if stamp_ns >= self._next_sample_ns and len(self._images) > 1:
            self._next_sample_ns += round(self._settings.interval * NS)
            self._next_sample_ns = max(self._next_sample_ns, stamp_ns + 1)
            self._held.append(self._sample(stamp_ns, cycle, noise_power))
            found = self._release()
        if not self._keys or stamp_ns - self._keys[-1][0] >= self._key_interval_ns:
            self._learn(stamp_ns, gray, noise_power)
            self._keep(stamp_ns, gray)
        return found

    @property
    def ready(self) -> bool:
        """Whether enough unrelated image pairs have been seen."""
        return self._response.pairs >= _PAIRS_NEEDED

    def _sample(self, stamp_ns: int, cycle: tuple[int, int | None], noise_power: float) -> _Sample:
        gray = self._images[-1][1]
        usable = [lag for lag in self._lags if lag < len(self._images)]
        earlier = [self._images[-1 - lag] for lag in usable]
        powers = [difference_power(gray, one[1]) - noise_power * gray.size for one in earlier]
        return _Sample(
            stamp_ns=stamp_ns,
            cycle=cycle[0],
            cycle_start_ns=cycle[1],
            noise_power=noise_power,
            windows_ns=np.array([stamp_ns - one[0] for one in earlier]),
            powers=np.array(powers),
        )

    def _release(self) -> tuple[Displacement, ...]:
        if not self.ready:
            return ()
        held, self._held = self._held, []
        found = []
        for sample in held:
            one = self._displacement(sample)
            if self._last_emitted_ns is None or one.stamp_ns > self._last_emitted_ns:
                self._last_emitted_ns = one.stamp_ns
                found.append(one)
        return tuple(found)

    def _chosen_lag(self, sample: _Sample, response: BeadResponse) -> int:
        low_enough = sample.powers <= self._settings.saturation * response.plateau
        # The lags before the first that is too long, so that a chance return is no choice.
        return max(0, int(np.argmin(np.append(low_enough, False))) - 1)

    def _displacement(self, sample: _Sample) -> Displacement:
        lag = self._chosen_lag(sample, self._response)
        power = sample.powers[lag : lag + 1]
        pixels = self._images[-1][1].size
        window = int(sample.windows_ns[lag])
        away = float(self._response.displacement(power)[0])
        error = float(self._response.displacement_error(power, sample.noise_power, pixels)[0])
        loss = min(0.5, _DEFLECTION_LOSS * away / self._diameter_px)
        scatter = np.sqrt(_DEFLECTION_SCATTER * loss / self._beads) * away
        return Displacement(
            stamp_ns=sample.stamp_ns - window // 2,
            window_ns=window,
            cycle=sample.cycle,
            cycle_start_ns=sample.cycle_start_ns,
            pixels=away / (1.0 - loss),
            pixels_error=float(np.hypot(error, scatter)),
        )

    def _learn(self, stamp_ns: int, gray: NDArray[np.uint8], noise_power: float) -> None:
        if not self._keys or self._response.pairs >= _PAIRS_KEPT:
            return
        if not self.ready:
            self._guess(gray, noise_power)
        self._extend_path(stamp_ns, noise_power)
        path_now = self._path[-1]
        for key_stamp, key in reversed(self._keys):
            path = path_now - float(np.interp(key_stamp, self._path_stamps, self._path))
            if path >= _UNRELATED_PATH * self._diameter_px:
                self._response.add(gray, key, noise_power, path)
                return

    def _keep(self, stamp_ns: int, gray: NDArray[np.uint8]) -> None:
        self._keys.append((stamp_ns, gray))
        if len(self._keys) > _KEYS_KEPT:
            # Slow beads need images ever further apart: keep every other, all the way back.
            del self._keys[1::2]
            self._key_interval_ns *= 2

    def _guess(self, gray: NDArray[np.uint8], noise_power: float) -> None:
        """A response from the two images furthest apart, until there is a better one."""
        self._first_guess = BeadResponse(self._diameter_px, self._beads)
        self._first_guess.add(gray, self._keys[0][1], noise_power)

    def _extend_path(self, stamp_ns: int, noise_power: float) -> None:
        """How far a bead has come since the shaking event, on average, in pixels."""
        if not self._path:
            self._path_stamps.append(self._keys[-1][0])
            self._path.append(0.0)
        step = 0.0
        response = self._response if self.ready else self._first_guess
        # Without motion the guess is made of noise and would lead anywhere.
        if response.plateau > noise_power * self._images[-1][1].size:
            sample = self._sample(stamp_ns, (0, None), noise_power)
            lag = self._chosen_lag(sample, response)
            pixels = float(response.displacement(sample.powers[lag : lag + 1])[0])
            step = pixels * (stamp_ns - self._path_stamps[-1]) / float(sample.windows_ns[lag])
        self._path_stamps.append(stamp_ns)
        self._path.append(self._path[-1] + step)


def _ladder(longest: int) -> tuple[int, ...]:
    """Lags that grow by about a third each, from one frame to the longest."""
    lags = [1]
    while lags[-1] < longest:
        lags.append(min(longest, max(lags[-1] + 1, (4 * lags[-1] + 1) // 3)))
    return tuple(lags)
