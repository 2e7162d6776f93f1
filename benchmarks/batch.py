"""Many bags: speed-up of two cores, memory against length, and a campaign with damaged bags.

Films of one tray are looped and copied, which is faster than filming. The whole plate is filmed
once, for the memory of a worker with all eight trays.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.recordings.bag.find_bags import find_bags
from nanorocks_ros.recordings.bag.fingerprint import content_hash, file_states, total_size
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import (
    compressed_image_message,
    time_message,
)
from nanorocks_ros.settings import (
    CompressionSettings,
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
)
from nanorocks_ros.studies.batch.batch_analysis import BatchPlan, run_batch
from nanorocks_ros.studies.batch.batch_files import write_batch
from nanorocks_ros.studies.batch.campaign_means import combined
from nanorocks_ros.studies.reproduction.campaign_plan import plate_settings
from nanorocks_ros.studies.synthetic.film_bag import START_NS, film_into_bag
from nanorocks_ros.studies.synthetic.film_scene import SceneRecorder
from nanorocks_ros.wire import topics

_SECONDS = 20.0
_NS = 1_000_000_000
_CAMERA = topics.RAW_COMPRESSED.absolute()
# Bags, films in a bag, and rounds for each number of cores.
_BAGS, _LOOPS, _ROUNDS = 8, 1, 2
# Duration of independent decoding, for the speed-up of two cores without shared work, [s].
_DECODE_S = 3.0
# Lengths of the bags for the comparison of memory, in films.
_SHORT, _LONG = 3, 30
_PLATE_SECONDS = 5.0
_CAMPAIGN, _FILMS, _SHORT_SECONDS = 178, 4, 3.5


class _PeakMemory:
    """Progress callback of a batch that records the peak memory of its workers, [MB]."""

    def __init__(self) -> None:
        self.peak = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def begin(self, *_) -> None:
        self._thread.start()

    def finished(self, *_) -> None:
        pass

    def notice(self, text) -> None:
        pass

    def _look(self) -> None:
        while not self._over.wait(0.1):
            for child in multiprocessing.active_children():
                try:
                    status = Path(f'/proc/{child.pid}/status').read_text()
                except OSError:
                    continue
                peaks = [line for line in status.splitlines() if line.startswith('VmHWM')]
                self.peak = max([self.peak, *(float(peak.split()[1]) / 1e3 for peak in peaks)])

    def stop(self) -> None:
        self._over.set()


def short_film(path: Path, seed: int, seconds: float) -> Path:
    """A bag of tray 1, shaken after 0.3 s."""
    film_into_bag(
        path,
        SimulationSettings(seed=seed, first_shake=0.3),
        duration=seconds,
        quality=85,
        progress=lambda *_: None,
    )
    return path


def _looped(path: Path, film: Path, loops: int) -> Path:
    """A bag that repeats a film, with a shaking event each time."""
    source = open_bag(film)
    frames = [
        (message.log_time_ns, bytes(source.deserialize(message).data))
        for message in source.messages([_CAMERA])
    ]
    length = frames[-1][0] - frames[0][0] + _NS // 30
    epoch = topics.EPOCH.absolute()
    table = {epoch: offered_topic(topics.EPOCH), _CAMERA: offered_topic(topics.RAW_COMPRESSED)}
    with BagWriter(path, table, metadata={}) as bag:
        bag.write(epoch, START_NS, time_message(START_NS))
        for loop in range(loops):
            for stamp_ns, jpeg in frames:
                time_ns = stamp_ns + loop * length
                message = compressed_image_message(
                    time_ns, 'camera', 'bgr8; jpeg compressed bgr8', jpeg
                )
                bag.write(_CAMERA, time_ns, message)
    return path


def _run(folder: Path, bags: Path, settings=None, workers=None):
    """A batch, its duration [s], and the peak memory of a worker [MB]."""
    plan = BatchPlan(
        bags=find_bags([str(bags)]), folder=folder, settings=settings or PipelineSettings()
    )
    memory = _PeakMemory()
    start = time.perf_counter()
    batch = run_batch(plan, Workers(processes=workers), memory)
    seconds = time.perf_counter() - start
    memory.stop()
    return batch, seconds, memory.peak


def _cores(folder: Path, film: Path) -> None:
    bags = folder / 'bags'
    first = _looped(bags / '0', film, _LOOPS)
    for number in range(1, _BAGS):
        shutil.copytree(first, bags / str(number))
    cores = sorted(os.sched_getaffinity(0))
    best = {1: float('inf'), 2: float('inf')}
    frames = 0
    try:
        for turn in range(_ROUNDS):
            for count in best:
                os.sched_setaffinity(0, cores[:count])
                batch, seconds, _ = _run(folder / f'{turn}_{count}', bags)
                frames = sum(result.summary['frames'] for result in batch.results)
                best[count] = min(best[count], seconds)
    finally:
        os.sched_setaffinity(0, cores)
    print(f'{_BAGS} bags of {frames // _BAGS} frames, a tray; best of {_ROUNDS}\n')
    print('| cores, workers | s | frames/s | ratio |')
    print('| --- | --- | --- | --- |')
    for count, seconds in best.items():
        print(f'| {count} | {seconds:.1f} | {frames / seconds:.0f} | {best[1] / seconds:.2f} |')
    single = max(_decoded_by(1, film) for _ in range(_ROUNDS))
    two = max(_decoded_by(2, film) for _ in range(_ROUNDS))
    print(f'\ntwo processes that only decode, over one: {two / single:.2f}', flush=True)


def _decoding(film: str, barrier, rates) -> None:
    """Decode the film for some seconds, starting with the other processes; puts frames/s."""
    cv2.setNumThreads(1)
    bag = open_bag(film)
    jpegs = [bytes(bag.deserialize(message).data) for message in bag.messages([_CAMERA])]
    frames = [np.frombuffer(jpeg, np.uint8) for jpeg in jpegs]
    barrier.wait()
    start, done = time.perf_counter(), 0
    while time.perf_counter() - start < _DECODE_S:
        cv2.imdecode(frames[done % len(frames)], cv2.IMREAD_COLOR)
        done += 1
    rates.put(done / (time.perf_counter() - start))


def _decoded_by(count: int, film: Path) -> float:
    """Total frames per second that independent processes decode."""
    context = multiprocessing.get_context('spawn')
    barrier, rates = context.Barrier(count), context.Queue()
    arguments = (str(film), barrier, rates)
    processes = [context.Process(target=_decoding, args=arguments) for _ in range(count)]
    for process in processes:
        process.start()
    total = sum(rates.get() for _ in processes)
    for process in processes:
        process.join()
    return total


def _memory(folder: Path, film: Path) -> None:
    print('\n| bag | trays | length [s] | cycles | peak of the worker [MB] |')
    print('| --- | --- | --- | --- | --- |')
    for loops in (_SHORT, _LONG):
        place = folder / f'{loops}'
        _looped(place / 'bags' / 'run', film, loops)
        batch, _, peak = _run(place / 'results', place / 'bags', workers=1)
        summary = batch.results[0].summary
        cycles = len(summary['trays']['1']['cycles'])
        print(f'| tray | 1 | {summary["seconds"]:.0f} | {cycles} | {peak:.0f} |', flush=True)
    size = total_size(file_states(place / 'bags' / 'run'))
    start = time.perf_counter()
    content_hash(place / 'bags' / 'run')
    rate = size / (time.perf_counter() - start)
    plate = folder / 'plate'
    scene = SceneSettings(trays=tuple(sorted(load_trays())))
    recorder = SceneRecorder(SimulationSettings(first_shake=0.5), scene, _PLATE_SECONDS)
    (plate / 'bags').mkdir(parents=True)
    recorder.into_bag(plate / 'bags' / 'run', CompressionSettings(), 85, lambda *_: None)
    batch, _, peak = _run(plate / 'results', plate / 'bags', plate_settings(), workers=1)
    summary = batch.results[0].summary
    cycles = max(len(tray['cycles']) for tray in summary['trays'].values())
    print(f'| plate, 1080p | 8 | {summary["seconds"]:.0f} | {cycles} | {peak:.0f} |\n')
    print(f'content hashed at {rate / 1e6:.0f} MB/s', flush=True)


def broken_bags(folder: Path, film: Path) -> None:
    """Write one damaged bag of each kind; two of them are partly readable."""
    content = next(film.glob('*.mcap')).read_bytes()
    (folder / 'truncated.mcap').write_bytes(content[: len(content) * 3 // 5])
    (folder / 'empty.mcap').touch()
    (folder / 'wrong_magic.mcap').write_bytes(b'RIFF' + content[4:])
    flipped = bytearray(content)
    for place in range(len(content) // 3, len(content) // 2, 500):
        flipped[place] ^= 0x10
    (folder / 'flipped.mcap').write_bytes(flipped)
    with BagWriter(
        folder / 'no_camera', {'/chatter': offered_topic(topics.EPOCH)}, metadata={}
    ) as bag:
        bag.write('/chatter', START_NS, time_message(START_NS))


def _campaign(folder: Path) -> None:
    bags = folder / 'bags'
    films = [short_film(folder / f'film_{k}', k, _SHORT_SECONDS) for k in range(_FILMS)]
    for number in range(_CAMPAIGN - 5):
        shutil.copytree(films[number % _FILMS], bags / f'run_{number}')
    broken_bags(bags, films[0])
    settings = PipelineSettings()
    batch, seconds, peak = _run(folder / 'results', bags)
    # Copies count here as separate recordings.
    batch.results = [replace(result, twin='') for result in batch.results]
    start = time.perf_counter()
    combined_results = combined(batch.counted, settings)
    write_batch(folder / 'results', batch, combined_results, settings, 'csv')
    report = time.perf_counter() - start
    _, again, _ = _run(folder / 'results', bags)
    frames = sum(result.summary['frames'] for result in batch.results)
    print(f'\n{_CAMPAIGN} bags, 5 of them broken: {len(batch.results)} analysed, {frames} frames')
    print(f'on all cores: {seconds:.0f} s, at most {peak:.0f} MB a worker')
    print(f'means, tables and report of {len(combined_results.cycles)} cycles: {report:.1f} s')
    print(f'the same again, with what failed: {again:.1f} s\n')
    for failure in batch.failed:
        reason = failure.reason.partition(': ')[2].partition(';')[0]
        print(f'failed: {Path(failure.name).name}: {reason}')
    for result in batch.results:
        if not result.summary['complete']:
            print(f'in part: {Path(result.name).name}: {result.summary["frames"]} frames')
    size = sum(path.stat().st_size for path in (folder / 'results').rglob('*') if path.is_file())
    print(f'results: {size / 1e6 / len(batch.results):.1f} MB a bag')


def report() -> None:
    """Print all tables."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        film = short_film(folder / 'film', 1, _SECONDS)
        _cores(folder / 'cores', film)
        _memory(folder / 'memory', film)
        _campaign(folder / 'campaign')
