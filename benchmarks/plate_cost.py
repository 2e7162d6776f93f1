"""CPU time of each stage for a frame of the whole plate.

Eight trays, 1080p, all effects, 7 mm/s after shaking, on one core; the live graph with its
messages is measured by `live_plate`.
"""

from __future__ import annotations

import time
from collections import defaultdict

import cv2

from benchmarks.films import SCALE, filmed
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.experiment.view import View
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.records import Frame, SpeedEstimate, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.bodies.body_counter import BodyCounter
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.tracking.tracker import Tracker

_TRAYS = (1, 2, 3, 4, 5, 6, 7, 8)
_FRAMES = 210
_WARM_UP = 60


class _Clock:
    """CPU time by name, for the frames after the warm-up."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = defaultdict(float)
        self.running = False

    def timed(self, name: str, work, *arguments):
        start = time.process_time()
        result = work(*arguments)
        if self.running:
            self.spent[name] += time.process_time() - start
        return result


def _push(pipeline: Pipeline, clock: _Clock, frame: Frame) -> list[TrayImage]:
    records = clock.timed('preprocessing', pipeline.preprocessor.push, frame)
    images = [record for record in records if isinstance(record, TrayImage)]
    for image in images:
        tray = pipeline.trays[image.tray]
        for speed in clock.timed('speeds', tray.measurement.push, image):
            if isinstance(speed, SpeedEstimate):
                clock.timed('fits of the decay', tray.restitution.push, speed)
        clock.timed('autocorrelations', tray.clusters.push, image)
    return images


def report() -> None:
    """Print the table."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    shots, film = filmed(7e-3, effects=True, frames=_FRAMES, trays=_TRAYS)
    names = {
        'trays': list(_TRAYS),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': SCALE,
    }
    settings = with_values(PipelineSettings(), names, 'benchmark')
    pipeline = Pipeline(settings, 'film', View(camera=film.camera.geometry.camera))
    trackers = {number: Tracker(settings, load_trays()[number]) for number in _TRAYS}
    trackers = {number: tracker for number, tracker in trackers.items() if not tracker.crowded}
    finders = {number: ContactFinder(load_trays()[number]) for number in trackers}
    counters = {number: BodyCounter(settings, load_trays()[number]) for number in trackers}
    clock = _Clock()
    for number, shot in enumerate(shots):
        clock.running = number >= _WARM_UP
        image = clock.timed('decoding', cv2.imdecode, shot.jpeg, cv2.IMREAD_COLOR)
        stamp_ns = round(1e9 * number / 30.0)
        frame = Frame(stamp_ns=stamp_ns, encoding='bgr8', image=image)
        for tray_image in _push(pipeline, clock, frame):
            if tray_image.tray in trackers:
                (tracks,) = clock.timed('tracking', trackers[tray_image.tray].push, tray_image)
                clock.timed('contacts', finders[tray_image.tray].push, tracks)
                clock.timed('bodies', counters[tray_image.tray].push, tracks)
    cv2.setNumThreads(threads)
    _print(clock, len(shots) - _WARM_UP, sorted(trackers))


def _print(clock: _Clock, frames: int, followed: list[int]) -> None:
    spent = {name: 1e3 * seconds / frames for name, seconds in clock.spent.items()}
    tracking, decoding = spent.pop('tracking'), spent.pop('decoding')
    spent['speeds'] -= tracking + spent['contacts'] + spent['bodies']
    rows = {
        'preprocessing': spent.pop('preprocessing'),
        f'tracking of trays {", ".join(map(str, followed))}': tracking,
        'contacts': spent.pop('contacts'),
        'bodies': spent.pop('bodies'),
        'speeds by tracks and structure function': spent.pop('speeds'),
        **spent,
    }
    rows['all stages'] = sum(rows.values())
    print('| stage | ms per frame | / decoding the JPEG |')
    print('| --- | --- | --- |')
    for name, milliseconds in rows.items():
        print(f'| {name} | {milliseconds:.2f} | {milliseconds / decoding:.2f} |')
    print(f'| decoding | {decoding:.2f} | 1 |')
