"""What a film states about itself against what was read of it.

Tested by ``test/recordings/film/test_film_losses.py``.
"""

from __future__ import annotations

from array import array
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.records import NS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

# Containers whose stated duration is written by the camera; FFmpeg estimates that of others.
_STATING = ('mov', 'matroska', 'flv', 'asf', 'avi')
# Steps that count as usual, and the share of them in a film of constant rate.
_TOLERANCE, _STEADY_SHARE = 0.1, 0.95
_GAP, _FEWEST = 1.5, 10
# Rounding of the stated duration, in frames, and shortest part that counts as missing, [s].
_FRAMES_OF_ROUNDING, _SHORTEST = 2, 0.2
# Sizes of the packets of transport streams, with the place of the byte that begins each, [bytes].
_PACKET_SIZES = {188: 0, 192: 4, 204: 0}
_SYNC, _PACKETS = b'G', 5
# Last byte of a GIF; some programs add zeros behind it, of which so many are looked at.
_GIF_END, _GIF_PADDING = b';', 1024
# Steps between frames that the clock of a camera hardly makes: longer than so many usual steps and
# than this time [s], and shorter than this [ns].
_FAR_STEPS, _FAR, _SHORTEST_STEP_NS = 1000, 600.0, 50_000


class FilmLosses:
    """Counts the packets of a film and notes their times.

    Parameters
    ----------
    expected : int
        Number of frames that the film states; 0 if it states none.
    duration : float, [s]
        Duration that it states; 0 if it states none.
    cut_end : str
        How its end shows that it was cut short, as `cut_end` tells it; empty if it does not.
    timed : bool
        Whether its times are used, not a rate that the user tells.
    """

    def __init__(
        self, expected: int, duration: float, *, cut_end: str = '', timed: bool = True
    ) -> None:
        self._expected = expected
        self._cut_end = cut_end
        self._timed = timed
        self._duration = duration
        self._times_ns = array('q')
        self._packets = 0

    def note(self, time_ns: int | None) -> None:
        """A packet of the film, with the time at which it is shown."""
        self._packets += 1
        if time_ns is not None and abs(time_ns) < 2**62:
            self._times_ns.append(time_ns)

    def sentences(self) -> Iterator[str]:
        """What is missing, in sentences; known once the film has been read."""
        if self._cut_end:
            yield f'{self._cut_end}: it was cut short'
        if self._packets < self._expected:
            yield (
                f'states {self._expected} frames, {self._packets} are there: it was cut short, or '
                'parts of it are missing'
            )
            return
        times = np.unique(np.array(self._times_ns, dtype=np.int64))
        if self._timed and times.size:
            yield from _wrong_times(times, self._packets)
        if times.size < 2:
            return
        steps = np.diff(times)
        step = float(np.median(steps))
        length = (float(times[-1] - times[0]) + step) / NS
        missing = self._duration - length
        if missing > max(_SHORTEST, _FRAMES_OF_ROUNDING * step / NS):
            yield (
                f'states {self._duration:.2f} s, {length:.2f} s are there: it was cut short, or '
                'parts of it are missing'
            )
        if times.size >= _FEWEST:
            yield from _gaps(steps, step)


def _wrong_times(times: NDArray[np.int64], frames: int) -> Iterator[str]:
    """Times of a film, rising, that a camera hardly gives."""
    steps = np.diff(times)
    length = float(times[-1] - times[0]) / NS
    if length < _SHORTEST_STEP_NS * (frames - 1) / NS:
        yield (
            f'shows {frames} frames in {length:.3g} s; if that is not the rate of the camera, '
            'give it to `nanorocks import` by --rate, such as --rate 30'
        )
        return
    for place in np.flatnonzero(_are_far(steps)):
        yield (
            f'jumps by {steps[place] / NS:.6g} s after {(times[place] - times[0]) / NS:.3f} s: a '
            'time in it is wrong, or it joins recordings of different times'
        )


def _are_far(steps: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which steps are longer than any that frames which are lost would explain."""
    usual = float(np.median(steps)) if steps.size else 0.0
    far: NDArray[np.bool_] = steps > max(_FAR * NS, _FAR_STEPS * usual)
    return far


def _gaps(steps: NDArray[np.int64], step: float) -> Iterator[str]:
    """Gaps of a film whose rate is otherwise constant."""
    usual = np.abs(steps - step) <= _TOLERANCE * step
    if usual.mean() < _STEADY_SHARE:
        return
    gaps = steps[(steps > _GAP * step) & ~_are_far(steps)]
    if gaps.size:
        frames = int(np.sum(np.rint(gaps / step) - 1))
        yield f'has {gaps.size} gaps, where {frames} frames are missing'


def cut_end(path: Path, container: Any) -> str:
    """How the end of a file shows that the film was cut short; empty if it does not.

    An MPEG transport stream has packets of equal size, a GIF ends with a mark.

    Parameters
    ----------
    path : Path
    container : object of PyAV
    """
    if container.format.name == 'gif':
        return '' if _has_gif_end(path) else 'ends without the mark of its end'
    if container.format.name != 'mpegts':
        return ''
    with path.open('rb') as stream:
        head = stream.read(_PACKETS * max(_PACKET_SIZES))
    for size, sync in _PACKET_SIZES.items():
        if head[sync::size][:_PACKETS] == _SYNC * _PACKETS:
            in_packet = path.stat().st_size % size != 0
            return 'ends in the middle of a packet' if in_packet else ''
    return ''


def _has_gif_end(path: Path) -> bool:
    with path.open('rb') as stream:
        stream.seek(max(path.stat().st_size - _GIF_PADDING, 0))
        return stream.read().rstrip(b'\0').endswith(_GIF_END)


def stated_duration(container: Any, stream: Any) -> float:
    """Duration of the video that a container states, [s]; 0 if it states none.

    Parameters
    ----------
    container, stream : objects of PyAV
    """
    if not container.format.name.startswith(_STATING):
        return 0.0
    if stream.duration and stream.time_base:
        return float(stream.duration * Fraction(stream.time_base))
    # The longest of several streams need not be the film.
    if container.duration and len(container.streams) == 1:
        return float(container.duration) / 1e6
    return 0.0
