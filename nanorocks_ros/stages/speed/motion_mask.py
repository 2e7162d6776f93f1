"""The paper's motion mask: average, subtract, despeckle, binarise ([B19] fig. 4).

The paper's words allow several interpretations of "averaged over 10 frames, then each subtracted
from the next"; `averaging` and `time_step` of the settings select one.

Tested by ``test/studies/inspection/test_preprocessing_steps.py``.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from nanorocks_ros.settings import SpeedSettings

_DESPECKLE_PX = 3


class MotionMasker:
    """Keeps the last gray images and binarises the difference of their averages.

    Parameters
    ----------
    settings : SpeedSettings
    """

    def __init__(self, settings: SpeedSettings) -> None:
        self._threshold = settings.threshold
        self._one_frame = settings.time_step == 'one_frame'
        self._averaging = settings.averaging
        self._count = 1 if settings.averaging == 'none' else settings.averaged_frames
        kept = 2 * self._count if settings.averaging == 'block_mean' else self._count + 1
        self._images: deque[tuple[int, NDArray[np.uint8]]] = deque(maxlen=kept)

    def clear(self) -> None:
        """Forget all images but the last, with which the next is compared."""
        while len(self._images) > 1:
            self._images.popleft()

    def push(self, stamp_ns: int, gray: NDArray[np.uint8]) -> None:
        """Take the next image."""
        self._images.append((stamp_ns, gray))

    @property
    def full(self) -> bool:
        """Whether there are enough images for a mask."""
        return len(self._images) == self._images.maxlen

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last stamp of the images compared."""
        return self._images[0][0], self._images[-1][0]

    @property
    def time_step(self) -> float:
        """Time between the pictures compared, [s], by the interpretation in the settings."""
        first, last = self.span_ns
        steps = len(self._images) - 1
        if self._one_frame:
            return (last - first) / steps / NS
        if self._averaging == 'block_mean':
            return (last - first) * self._count / steps / NS
        return (last - first) / NS

    def difference(self) -> NDArray[np.uint8] | NDArray[np.float32]:
        """Absolute difference of the two averages, pixel by pixel, [gray levels].

        Of running means, times the number of frames averaged: consecutive ones differ by
        (last - first) / count, which gives the same mask and needs no mean.
        """
        images = [image for _, image in self._images]
        if self._averaging != 'block_mean':
            return np.asarray(cv2.absdiff(images[-1], images[0]), dtype=np.uint8)
        later = np.asarray(np.mean(images[self._count :], axis=0, dtype=np.float32))
        earlier = np.asarray(np.mean(images[: self._count], axis=0, dtype=np.float32))
        return np.asarray(cv2.absdiff(later, earlier), dtype=np.float32)

    def mask(self, noise_power: float) -> NDArray[np.uint8]:
        """Pixels in which the averages differ by more than the threshold: 255, else 0.

        Parameters
        ----------
        noise_power : float, [gray levels^2]
            Mean squared difference of two single images of a scene at rest.
        """
        count = self._count if self._averaging == 'block_mean' else 1
        noise = np.sqrt(noise_power / count)
        difference = cv2.medianBlur(self.difference(), _DESPECKLE_PX)
        return np.where(difference > self._threshold * noise, np.uint8(255), np.uint8(0))
