"""Puts a tray image together again from the topics on which its parts travel."""

from __future__ import annotations

from collections import deque

from nanorocks_ros.records import TrayImage

# Parts kept while others are on their way: two seconds at 30 Hz.
_KEPT = 60
# Parts of one topic come in order: it is another turn when the stamps go back by more.
_BACK_NS = 100_000_000
# Times in arrays are float32: known to so much, and to this share of the time since the epoch.
_ROUNDING_NS = 1_000_000
_ROUNDING = 2.0**-22


class TrayJoiner:
    """Waits for the state of an image and its pixels, whichever comes first.

    Parameters
    ----------
    tray : int
    """

    def __init__(self, tray):
        self._tray = tray
        self._states = deque(maxlen=_KEPT)
        self._grays = deque(maxlen=_KEPT)
        self._colors = deque(maxlen=_KEPT)
        self._last_ns = {}

    def state(self, state, epoch_ns):
        """Take a state; the images that are complete now."""
        tolerance = _ROUNDING_NS + _ROUNDING * abs(state.stamp_ns - epoch_ns)
        self._check_time('state', state.stamp_ns)
        self._states.append((state, tolerance))
        return self._complete()

    def gray(self, frame):
        """Take a gray image; the images that are complete now."""
        self._check_time('gray', frame.stamp_ns)
        self._grays.append(frame)
        return self._complete()

    def color(self, frame):
        """Take a colour image; the images that are complete now."""
        self._check_time('color', frame.stamp_ns)
        self._colors.append(frame)
        return self._complete()

    def _check_time(self, part, stamp_ns):
        """Let go of what is left from before a loop or a seek: it would pass for later parts."""
        last_ns, self._last_ns[part] = self._last_ns.get(part, stamp_ns), stamp_ns
        if stamp_ns < last_ns - _BACK_NS:
            # Other parts may have come first: those of now are closer to this one.
            latest_ns = (stamp_ns + last_ns) // 2
            self._states = _until(self._states, latest_ns, lambda one: one[0].stamp_ns)
            self._grays = _until(self._grays, latest_ns, lambda one: one.stamp_ns)
            self._colors = _until(self._colors, latest_ns, lambda one: one.stamp_ns)

    def _complete(self):
        images = []
        while self._states:
            state, tolerance = self._states[0]
            parts = [self._grays] + [self._colors] * bool(state.color)
            near = [_nearest(part, state.stamp_ns, tolerance) for part in parts]
            if any(one is None for one in near):
                if not all(_passed(part, state.stamp_ns, tolerance) for part in parts):
                    break
                # A part was lost on the way, and with it the image.
                self._states.popleft()
                continue
            self._states.popleft()
            gray, *color = near
            images.append(
                TrayImage.of_state(
                    state, gray.stamp_ns, gray.image, color[0].image if color else None
                )
            )
        return images


def _until(parts, latest_ns, stamp_of):
    return deque((part for part in parts if stamp_of(part) <= latest_ns), maxlen=_KEPT)


def _nearest(frames, stamp_ns, tolerance):
    return next((frame for frame in frames if abs(frame.stamp_ns - stamp_ns) <= tolerance), None)


def _passed(frames, stamp_ns, tolerance):
    """Whether the image is there, or a later one is."""
    return any(frame.stamp_ns >= stamp_ns - tolerance for frame in frames)
