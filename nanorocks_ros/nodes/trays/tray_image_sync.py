"""Assembles tray images from the topics on which state, gray and colour travel."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from nanorocks_ros.records import TrayImage

if TYPE_CHECKING:
    from collections.abc import Iterable

    from nanorocks_ros.records import Frame, TrayState

# Parts kept while others are on their way: two seconds at 30 Hz.
_MAX_KEPT = 60
# Stamps of one topic increase; a larger step back counts as a loop or a seek.
_STEP_BACK_NS = 100_000_000
# Times in arrays are rounded to some nanoseconds.
_ROUNDING_NS = 1000


class TrayImageSync:
    """Waits for the state and the pixels of each image, in whatever order they arrive."""

    def __init__(self) -> None:
        self._states: deque[TrayState] = deque(maxlen=_MAX_KEPT)
        self._grays: deque[Frame] = deque(maxlen=_MAX_KEPT)
        self._colors: deque[Frame] = deque(maxlen=_MAX_KEPT)
        self._last_ns: dict[str, int] = {}

    def add_state(self, state: TrayState) -> list[TrayImage]:
        """Add a state; the images that are complete now."""
        self._forget_before_step_back('state', state.stamp_ns)
        self._states.append(state)
        return self._complete()

    def add_gray(self, frame: Frame) -> list[TrayImage]:
        """Add a gray image; the images that are complete now."""
        self._forget_before_step_back('gray', frame.stamp_ns)
        self._grays.append(frame)
        return self._complete()

    def add_color(self, frame: Frame) -> list[TrayImage]:
        """Add a colour image; the images that are complete now."""
        self._forget_before_step_back('color', frame.stamp_ns)
        self._colors.append(frame)
        return self._complete()

    def _forget_before_step_back(self, part: str, stamp_ns: int) -> None:
        """Forget what is left from before a loop or a seek: it looks like later parts."""
        last_ns, self._last_ns[part] = self._last_ns.get(part, stamp_ns), stamp_ns
        if stamp_ns < last_ns - _STEP_BACK_NS:
            # Other parts from after the step may have arrived first: their stamps are closer to
            # the new stamp than to the last one.
            latest_ns = (stamp_ns + last_ns) // 2
            self._states = deque(
                (state for state in self._states if state.stamp_ns <= latest_ns),
                maxlen=_MAX_KEPT,
            )
            self._grays = _frames_until(self._grays, latest_ns)
            self._colors = _frames_until(self._colors, latest_ns)

    def _complete(self) -> list[TrayImage]:
        images = []
        while self._states:
            state = self._states[0]
            gray = _at(self._grays, state.stamp_ns)
            color = _at(self._colors, state.stamp_ns) if state.color else None
            if gray is not None and (color is not None or not state.color):
                pixels = None if color is None else color.image
                images.append(TrayImage.of_state(state, gray.stamp_ns, gray.image, pixels))
            elif not self._is_past(state):
                break
            # Without an image here, a part of it was lost in transport.
            self._states.popleft()
        return images

    def _is_past(self, state: TrayState) -> bool:
        """Whether every topic has reached the stamp of a state."""
        topics = (self._grays, self._colors) if state.color else (self._grays,)
        earliest_ns = state.stamp_ns - _ROUNDING_NS
        return all(any(frame.stamp_ns >= earliest_ns for frame in frames) for frames in topics)


def _frames_until(frames: Iterable[Frame], latest_ns: int) -> deque[Frame]:
    return deque((frame for frame in frames if frame.stamp_ns <= latest_ns), maxlen=_MAX_KEPT)


def _at(frames: Iterable[Frame], stamp_ns: int) -> Frame | None:
    return next(
        (frame for frame in frames if abs(frame.stamp_ns - stamp_ns) <= _ROUNDING_NS), None
    )
