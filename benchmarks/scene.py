"""The whole scene at 1080p with all effects: ms of a frame by part, on one core.

CPU times, medians over the frames of the 2 s after a shaking event, when the plate oscillates and
the gas is fast. Compression is listed separately. Ratios are relative to encoding the same frames
as JPEG (quality 90).
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import replace

import cv2
import numpy as np
from scipy import ndimage

from nanorocks_ros.settings import (
    CompressionSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.simulation.plate_scene import moving_plate, plate_camera, plate_film
from nanorocks_ros.simulation.plate_scene.drawing import painter
from nanorocks_ros.studies.synthetic.film_compression import H264Stream, compressed

_FRAMES = 60
_KEPT = 3
_QUALITY = 90
_MEGA = 1e6

# Timed functions: label, module or class, name.
_PARTS = (
    ('gas in eight trays', plate_film.ShakenTray, 'at'),
    ('plate, shifted while it swings', moving_plate.MovingPlate, 'displaced'),
    ('shadows', painter, 'draw_shadows'),
    ('beads and grains', painter, 'draw_bodies'),
    ('glare', plate_camera, 'add_light'),
    ('light, noise, gray levels', plate_camera, 'expose'),
)


def report() -> None:
    """Print the tables."""
    cv2.setNumThreads(1)
    with _timed() as spent:
        images, moving = _run(SceneSettings(), spent)
    parts = {name: 1e3 * np.median(times) for name, times in spent.items()}
    jpeg = 1e3 * np.median([_seconds(_encode, image) for image in images])
    decode = 1e3 * np.median([_seconds(_decode, _encode(image)) for image in images])
    print('| part | ms | of JPEG encoding |\n| --- | --- | --- |')
    for name, cost in parts.items():
        print(f'| {name} | {cost:.1f} | {cost / jpeg:.2f} |')
    remainder = moving - sum(parts.values())
    print(f'| everything else | {remainder:.1f} | {remainder / jpeg:.2f} |')
    print(f'| **a frame, all effects** | **{moving:.1f}** | **{moving / jpeg:.2f}** |')
    print(f'\nThat is {1e3 / moving:.0f} frames a second.\n')
    _print_single(jpeg)
    _print_compression(images, jpeg, decode)
    _print_places()


def _run(scene: SceneSettings, spent=None):
    shaken = SimulationSettings(first_shake=0.0)
    filmed = plate_film.SceneFilm(shaken, scene)
    images, times = [], []
    filmed.at(0, 0)
    for times_of_part in (spent or {}).values():
        times_of_part.clear()
    for number in range(1, _FRAMES + 1):
        start = time.thread_time()
        moment = filmed.at(number, 0)
        times.append(time.thread_time() - start)
        # Most images are released, as in use, so that their memory is reused.
        if number % _KEPT == 0:
            images.append(moment.frame.image)
        for times_of_part in (spent or {}).values():
            times_of_part[number - 1 :] = [sum(times_of_part[number - 1 :])]
    return images, 1e3 * np.median(times)


@contextmanager
def _timed():
    """Time every call of the parts."""
    spent = {label: [] for label, _, _ in _PARTS}
    originals = []
    for label, place, name in _PARTS:
        originals.append((place, name, getattr(place, name)))
        setattr(place, name, _timing(getattr(place, name), spent[label]))
    try:
        yield spent
    finally:
        for place, name, function in originals:
            setattr(place, name, function)


def _timing(function, times):
    def timed(*arguments, **named):
        start = time.thread_time()
        result = function(*arguments, **named)
        times.append(time.thread_time() - start)
        return result

    return timed


def _print_single(jpeg: float) -> None:
    """Print the cost without single effects."""
    everything = SceneSettings()
    print('| scene | ms | of JPEG encoding |\n| --- | --- | --- |')
    cases = {
        'all effects, plate at rest': replace(everything, swing=0.0),
        'all effects but shadows': replace(everything, shadows=0.0),
        'all effects, trays 1 to 5': replace(everything, trays=(1, 2, 3, 4, 5)),
        'no effects': plate_film.without_effects(everything),
    }
    for name, scene in cases.items():
        _, cost = _run(scene)
        print(f'| {name} | {cost:.1f} | {cost / jpeg:.2f} |')
    print()


def _print_compression(images, jpeg: float, decode: float) -> None:
    size = np.mean([len(_encode(image)) for image in images])
    print('| compression | ms | MB per minute |\n| --- | --- | --- |')
    print(f'| JPEG, quality {_QUALITY} | {jpeg:.1f} | {1800 * size / _MEGA:.0f} |')
    print(f'| decoding that | {decode:.1f} | |')
    flight = CompressionSettings(codec='jpeg_rate')
    shaken = SimulationSettings(first_shake=0.0)
    moments = plate_film.SceneFilm(shaken, SceneSettings()).moments(_FRAMES)
    sizes = [len(content) for _, content in compressed(moments, flight, quality=1, frame_rate=30)]
    print(f'| JPEG of the rate of the flight | | {1800 * np.mean(sizes) / _MEGA:.0f} |')
    try:
        stream = H264Stream(CompressionSettings(codec='h264'), 30.0)
    except Exception as error:
        print(f'| H.264 | {error} | |')
        return
    times = [_seconds(lambda image: list(stream.push(image)), image) for image in images]
    rate = 1800 * stream.bytes_written / len(images) / _MEGA
    print(f'| H.264 there and back | {1e3 * np.median(times):.1f} | {rate:.0f} |')


def _print_places() -> None:
    """Print errors of red beads of tray 1, found by colour, against the truth."""
    print('\n| red beads of tray 1 | found | mean column, row [px] | rms [px] |')
    print('| --- | --- | --- | --- |')
    everything = SceneSettings()
    cases = {'all effects': everything, 'no effects': plate_film.without_effects(everything)}
    for name, scene in cases.items():
        simulation = SimulationSettings(first_shake=0.0)
        filmed = plate_film.SceneFilm(simulation, replace(scene, trays=(1,)))
        errors = np.concatenate([_places(filmed, number) for number in range(0, 60, 3)])
        mean = ', '.join(f'{value:.3f}' for value in errors.mean(axis=0))
        rms = ', '.join(f'{value:.3f}' for value in np.sqrt((errors**2).mean(axis=0)))
        print(f'| {name} | {len(errors)} | {mean} | {rms} |')


def _places(filmed, number):
    """Centroids of red spots of the size of one bead, minus the position of the bead, (n, 2)."""
    moment = filmed.at(number, 0)
    geometry, beads = filmed.camera.geometry, moment.beads[0]
    lens = geometry.camera
    positions = beads.positions[:, :2] + beads.displacement
    rectified = geometry.rectified(1, positions) - 0.5
    flat = (rectified - lens.matrix[:2, 2]) / lens.focal
    expected = cv2.fisheye.distortPoints(flat[None], lens.matrix, np.array(lens.distortion))[0]
    blue, green, red = np.moveaxis(moment.frame.image.astype(float), 2, 0)
    spots, count = ndimage.label(red - 0.5 * (blue + green) > 30.0)
    labels = range(1, count + 1)
    areas = ndimage.sum(spots > 0, spots, labels)
    centres = np.array(ndimage.center_of_mass(spots > 0, spots, labels))[:, ::-1]
    # Larger spots are several beads in contact.
    single = centres[(areas > 300) & (areas < 500)]
    gaps = single[:, np.newaxis] - expected
    nearest = np.hypot(*np.moveaxis(gaps, 2, 0)).argmin(axis=1)
    return gaps[np.arange(len(single)), nearest]


def _encode(image):
    return cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]


def _decode(content):
    return cv2.imdecode(content, cv2.IMREAD_COLOR)


def _seconds(function, argument) -> float:
    start = time.thread_time()
    function(argument)
    return time.thread_time() - start
