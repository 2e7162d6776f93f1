"""Puts a tray image together again from the topics on which its parts travel."""

from __future__ import annotations

from collections import deque

from nanorocks_ros.records import TrayImage

# Parts kept while others are on their way: two seconds at 30 Hz.
_KEPT = 60
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

    def state(self, state, epoch_ns):
        """Take a state; the images that are complete now."""
        tolerance = _ROUNDING_NS + _ROUNDING * abs(state.stamp_ns - epoch_ns)
        self._states.append((state, tolerance))
        return self._complete()

    def gray(self, frame):
        """Take a gray image; the images that are complete now."""
        self._grays.append(frame)
        return self._complete()

    def color(self, frame):
        """Take a colour image; the images that are complete now."""
        self._colors.append(frame)
        return self._complete()

    def _complete(self):
        found = []
        while self._states:
            state, tolerance = self._states[0]
            parts = [self._grays] + [self._colors] * bool(state.color)
            near = [_nearest(one, state.stamp_ns, tolerance) for one in parts]
            if any(one is None for one in near):
                if not all(_passed(one, state.stamp_ns, tolerance) for one in parts):
                    break
                # A part was lost on the way, and with it the image.
                self._states.popleft()
                continue
            self._states.popleft()
            gray, *color = near
            found.append(
                TrayImage.of_state(
                    state, gray.stamp_ns, gray.image, color[0].image if color else None
                )
            )
        return found


def _nearest(frames, stamp_ns, tolerance):
    return next((one for one in frames if abs(one.stamp_ns - stamp_ns) <= tolerance), None)


def _passed(frames, stamp_ns, tolerance):
    """Whether the image is there, or a later one is."""
    return any(one.stamp_ns >= stamp_ns - tolerance for one in frames)
