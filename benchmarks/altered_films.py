"""Films by other code, altered as other cameras, recorders and users would: right or flagged?

Each film keeps its physics and its truth; picture, codec, clock, or what the user says of it
changes. Results stand beside those of the film as it is. ``NANOROCKS_ALTERATION`` selects the
alterations whose names contain it.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import av
import cv2
import numpy as np

from benchmarks.film_measurement import measure
from benchmarks.film_truth import read_truth
from benchmarks.foreign_world import FOREIGN, films_by_other_code, foreign_row, print_heading
from nanorocks_ros.cli.progress_bar import Progress
from nanorocks_ros.jobs.tasks import Workers, run_tasks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    _Picture = NDArray[np.uint8]
    _Change = Callable[[_Picture, int], _Picture]

_FILMS = ('a1_89_99', 'p3a', 's1_turn')
_CRF = 20
_LOW_CRF = 32
# Brightness over a film, over a lamp's cycle, and its exponent.
_DIMMING, _FLICKER, _GAMMA = 0.35, 0.04, 0.6
_FRAMES_OF_CHANGE = 1200
_VIGNETTE = 0.35
_NOISE = 6.0
_TURN_DEG = 2.0
_SMALLER = 0.7
_WRONG_SCALE = 1.03
# Width of what is squeezed; distortion of a lens at the edge of the picture, and growth by a zoom.
_NARROWER, _BARREL, _ZOOM = 0.97, 0.03, 0.02
# Lens blur [px], gain of the sharpening, share of the picture before, and saturation.
_BLUR, _SHARPENING, _GHOST, _PALER = 1.5, 1.0, 0.3, 0.5
# Of a dark spot on the lens: place as a part of the picture, and radius [px].
_SPOT, _SPOT_PX = (0.45, 0.55), 12
_EVERY = 10
_CLICK = 37


@dataclass(frozen=True, kw_only=True)
class Alteration:
    """What is changed in a film.

    Parameters
    ----------
    picture : callable, optional
        From a picture and its number to the altered picture.
    numbers : callable, optional
        From the number of frames to those that are written, in order.
    keeps_times : bool
        Whether frames keep their times where others are missing; otherwise they move together.
    crf : int
        Quality of H.264; more is worse.
    size, scale : float
        Factors of the picture's size, and of the scale that the user tells.
    """

    picture: _Change | None = None
    numbers: Callable[[int], NDArray[np.int64]] = np.arange
    keeps_times: bool = True
    crf: int = _CRF
    size: float = 1.0
    scale: float = 1.0


def _brightness(factor: Callable[[int], float]) -> _Change:
    return lambda image, number: cv2.convertScaleAbs(image, alpha=factor(number))


def _gamma(image: _Picture, _: int) -> _Picture:
    table = 255.0 * (np.arange(256) / 255.0) ** _GAMMA
    return cv2.LUT(image, table.round().astype(np.uint8))


def _vignette(image: _Picture, _: int) -> _Picture:
    height, width = image.shape[:2]
    x, y = np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height)
    gain = 1.0 - _VIGNETTE * 0.5 * (x**2 + y[:, np.newaxis] ** 2)
    return (image * gain[..., np.newaxis]).round().astype(np.uint8)


def _noise(image: _Picture, number: int) -> _Picture:
    random = np.random.default_rng(number)
    noisy = image + _NOISE * random.standard_normal(image.shape)
    return noisy.round().clip(0, 255).astype(np.uint8)


def _turned(image: _Picture, _: int) -> _Picture:
    height, width = image.shape[:2]
    turn = cv2.getRotationMatrix2D((0.5 * width, 0.5 * height), _TURN_DEG, 1.0)
    return cv2.warpAffine(
        image, turn, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


def _warped(image: _Picture, x: NDArray[np.float64], y: NDArray[np.float64]) -> _Picture:
    """The picture that shows at each place what was at the given one, from -1 to 1."""
    height, width = image.shape[:2]
    places = [
        (0.5 * (size - 1) * (1.0 + axis)).astype(np.float32)
        for axis, size in ((x, width), (y, height))
    ]
    return cv2.remap(image, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def _axes(image: _Picture) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    height, width = image.shape[:2]
    y, x = np.mgrid[-1.0 : 1.0 : height * 1j, -1.0 : 1.0 : width * 1j]
    return x, y


def _squeezed(image: _Picture, _: int) -> _Picture:
    x, y = _axes(image)
    return _warped(image, x / _NARROWER, y)


def _barrel(image: _Picture, _: int) -> _Picture:
    x, y = _axes(image)
    outer = 1.0 + _BARREL * (x**2 + y**2)
    return _warped(image, x * outer, y * outer)


def _zoomed(image: _Picture, number: int) -> _Picture:
    x, y = _axes(image)
    larger = 1.0 + _ZOOM * number / _FRAMES_OF_CHANGE
    return _warped(image, x / larger, y / larger)


def _blurred(image: _Picture, _: int) -> _Picture:
    return cv2.GaussianBlur(image, (0, 0), _BLUR)


def _sharpened(image: _Picture, _: int) -> _Picture:
    soft = cv2.GaussianBlur(image, (0, 0), 1.0)
    return cv2.addWeighted(image, 1.0 + _SHARPENING, soft, -_SHARPENING, 0.0)


def _pale(image: _Picture, number: int) -> _Picture:
    return cv2.addWeighted(image, _PALER, _gray(image, number), 1.0 - _PALER, 0.0)


def _spotted(image: _Picture, _: int) -> _Picture:
    height, width = image.shape[:2]
    place = round(_SPOT[0] * width), round(_SPOT[1] * height)
    return cv2.circle(image.copy(), place, _SPOT_PX, (40, 40, 40), -1, cv2.LINE_AA)


def _with_clock(image: _Picture, number: int) -> _Picture:
    text = f'{number // 1800:02d}:{number // 30 % 60:02d}:{number % 30:02d}'
    place, font = (20, 40), cv2.FONT_HERSHEY_SIMPLEX
    return cv2.putText(image.copy(), text, place, font, 1.0, (255, 255, 255), 2, cv2.LINE_AA)


class _WithPrevious:
    """A change that mixes a picture with the one before, by a function of both."""

    def __init__(self, mix: Callable[[_Picture, _Picture], _Picture]) -> None:
        self._mix = mix
        self._previous: _Picture | None = None

    def __call__(self, image: _Picture, number: int) -> _Picture:
        """The altered picture; the first one of a film stays as it is."""
        previous = image if number == 0 or self._previous is None else self._previous
        self._previous = image
        return self._mix(image, previous)


def _ghosts(image: _Picture, previous: _Picture) -> _Picture:
    return cv2.addWeighted(image, 1.0 - _GHOST, previous, _GHOST, 0.0)


def _interlaced(image: _Picture, previous: _Picture) -> _Picture:
    """Every second line is that of the picture before."""
    woven = image.copy()
    woven[1::2] = previous[1::2]
    return woven


def _gray(image: _Picture, _: int) -> _Picture:
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)


def _warm(image: _Picture, _: int) -> _Picture:
    return (image * np.array([0.75, 0.95, 1.0])).round().astype(np.uint8)


def _without(every: int) -> Callable[[int], NDArray[np.int64]]:
    return lambda count: np.flatnonzero(np.arange(count) % every != every - 1)


def _repeated(count: int) -> NDArray[np.int64]:
    """Every tenth frame holds the picture before it."""
    numbers = np.arange(count)
    return numbers - (numbers % _EVERY == _EVERY - 1)


ALTERATIONS: dict[str, Alteration] = {
    'as it is, written again': Alteration(),
    f'H.264 at crf {_LOW_CRF}': Alteration(crf=_LOW_CRF),
    f'light falls by {_DIMMING:.0%} in {_FRAMES_OF_CHANGE} frames': Alteration(
        picture=_brightness(lambda number: 1.0 - _DIMMING * number / _FRAMES_OF_CHANGE)
    ),
    f'light flickers by {_FLICKER:.0%}': Alteration(
        picture=_brightness(lambda number: 1.0 + _FLICKER * (-1.0) ** number)
    ),
    'brighter midtones': Alteration(picture=_gamma),
    'dark corners': Alteration(picture=_vignette),
    f'noise of {_NOISE:g} gray levels': Alteration(picture=_noise),
    'gray': Alteration(picture=_gray),
    'warm light': Alteration(picture=_warm),
    f'turned by {_TURN_DEG:g} degrees': Alteration(picture=_turned),
    'mirrored': Alteration(picture=lambda image, _: np.ascontiguousarray(image[:, ::-1])),
    f'{_SMALLER:g} times the size': Alteration(size=_SMALLER),
    f'every {_EVERY}th frame missing': Alteration(numbers=_without(_EVERY)),
    f'every {_EVERY}th missing, without a gap': Alteration(
        numbers=_without(_EVERY), keeps_times=False
    ),
    f'every {_CLICK}th missing, without a gap': Alteration(
        numbers=_without(_CLICK), keeps_times=False
    ),
    f'every {_EVERY}th repeated': Alteration(numbers=_repeated, keeps_times=False),
    'every second frame missing': Alteration(numbers=_without(2)),
    f'pictures hold {_GHOST:.0%} of the one before': Alteration(picture=_WithPrevious(_ghosts)),
    'interlaced': Alteration(picture=_WithPrevious(_interlaced)),
    f'lens blur of {_BLUR:g} px': Alteration(picture=_blurred),
    'sharpened': Alteration(picture=_sharpened),
    'half the saturation': Alteration(picture=_pale),
    'a dark spot on the lens': Alteration(picture=_spotted),
    'a clock in the picture': Alteration(picture=_with_clock),
    f'squeezed to {_NARROWER:g} in width': Alteration(picture=_squeezed),
    f'lens that distorts by {_BARREL:.0%}': Alteration(picture=_barrel),
    f'zoom by {_ZOOM:.0%} in {_FRAMES_OF_CHANGE} frames': Alteration(picture=_zoomed),
    f'scale told {_WRONG_SCALE - 1:+.0%}': Alteration(scale=_WRONG_SCALE),
    f'scale told {1 / _WRONG_SCALE - 1:+.0%}': Alteration(scale=1.0 / _WRONG_SCALE),
}
"""Names and changes, in the order of the table."""


def report() -> None:
    """Alter, measure, and print a row for each film and alteration."""
    videos = [video for video in films_by_other_code() if video.stem in _FILMS]
    if not videos:
        print(f'No films by other code: set {FOREIGN} to a folder that holds some.')
        return
    selected = os.environ.get('NANOROCKS_ALTERATION', '')
    names = [name for name in ALTERATIONS if selected in name]
    tasks = {f'{video.stem}: {name}': (video, name) for video in videos for name in names}
    with Progress('altered films') as progress:
        rows = run_tasks(_row, tasks, Workers(), progress.count)
    print_heading()
    for row in rows:
        print(row)


def _row(video_and_name: tuple[Path, str]) -> str:
    video, name = video_and_name
    film, alteration = read_truth(video), ALTERATIONS[name]
    with tempfile.TemporaryDirectory() as folder:
        altered = Path(folder) / f'{video.stem}.mp4'
        _write(video, altered, alteration, round(film.frame_rate))
        scale = film.scale * alteration.size * alteration.scale
        result = measure(replace(film, video=altered, scale=scale))
    return foreign_row(replace(film, video=Path(f'{video.stem}: {name}.mp4')), result)


def _write(video: Path, path: Path, alteration: Alteration, rate: int) -> None:
    """Write the altered film, H.264 with the stamps that its frames have."""
    images = list(_images(video))
    with av.open(str(path), 'w') as container:
        options = {'crf': str(alteration.crf)}
        stream = container.add_stream('libx264', rate=rate, options=options)
        height, width = (round(alteration.size * side / 2) * 2 for side in images[0].shape[:2])
        stream.width, stream.height, stream.pix_fmt = width, height, 'yuv420p'
        for written, number in enumerate(alteration.numbers(len(images)).tolist()):
            image = images[number]
            if alteration.picture:
                image = alteration.picture(image, number)
            if alteration.size != 1.0:
                image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format='bgr24')
            frame.time_base = Fraction(1, rate)
            frame.pts = number if alteration.keeps_times else written
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _images(video: Path) -> Iterator[_Picture]:
    with av.open(str(video)) as container:
        for frame in container.decode(video=0):
            yield frame.to_ndarray(format='bgr24')
