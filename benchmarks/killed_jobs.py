"""The jobs that `python -m benchmarks kills` kills and resumes."""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.npz_archive import read_archive
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import image_message, time_message
from nanorocks_ros.records import NS
from nanorocks_ros.wire import topics

if TYPE_CHECKING:
    from collections.abc import Callable

_NANOROCKS = [str(Path(sys.executable).with_name('nanorocks'))]
_LONGEST_LOSS_S = 2.0
_RECORDED_S = (1.5, 5.0)
_FILMS, _FRAMES = 3, 150
_RECORDER = """
import os, sys, time
import numpy as np
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.recorder import Recorder
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.wire import topics

name = topics.RAW_COMPRESSED.absolute()
table = {name: offered_topic(topics.RAW_COMPRESSED)}
recorder = Recorder(sys.argv[1], table, metadata={})
content = np.random.default_rng(1).bytes(200_000)
while True:
    stamp = time.time_ns()
    recorder.advance(stamp)
    message = compressed_image_message(stamp, 'camera', 'jpeg', content)
    recorder.put(name, lambda message=message: message)
    os.write(1, b'%d\\n' % stamp)
    time.sleep(1 / 30)
"""


def _killed_after(command: list[str], seconds: float) -> bytes:
    """Run a command, kill it and all that it started, and return what it wrote."""
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
    )
    time.sleep(seconds)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    output, _ = process.communicate()
    return output


class _Recording:
    """A recording in real time, at 30 Hz."""

    def __init__(self, folder: Path) -> None:
        self._bag = folder / 'bag'
        folder.mkdir()

    def kill(self, random: np.random.Generator) -> tuple[bool, float]:
        shutil.rmtree(self._bag, ignore_errors=True)
        command = [sys.executable, '-c', _RECORDER, str(self._bag)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)
        assert process.stdout is not None
        stamps = [int(process.stdout.readline())]
        end = time.monotonic() + float(random.uniform(*_RECORDED_S))
        while time.monotonic() < end:
            stamps.append(int(process.stdout.readline()))
        os.killpg(process.pid, signal.SIGKILL)
        stamps += [int(line) for line in process.communicate()[0].split(b'\n')[:-1]]
        read = [message.log_time_ns for message in open_bag(self._bag).messages()]
        loss = (stamps[-1] - (read[-1] if read else stamps[0])) / 1e9
        return read == stamps[: len(read)] and loss <= _LONGEST_LOSS_S, loss


class _Resumed:
    """A command that is killed, run again, and compared with one that was not.

    Parameters
    ----------
    command : list of str
        OUTPUT stands for its output.
    fingerprint : callable
        Of the output, so that equal ones are bit-identical.
    """

    def __init__(
        self, folder: Path, command: list[str], fingerprint: Callable[[Path], str]
    ) -> None:
        self._command, self._fingerprint = command, fingerprint
        self._output = folder / 'output'
        began = time.monotonic()
        self._run()
        self._seconds = time.monotonic() - began
        self._wanted = fingerprint(self._output)

    def _filled(self) -> list[str]:
        return [word.replace('OUTPUT', str(self._output)) for word in self._command]

    def _run(self) -> None:
        subprocess.run(self._filled(), check=True, capture_output=True)

    def _clear(self) -> None:
        for path in self._output.parent.glob(f'*{self._output.stem}*'):
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    def kill(self, random: np.random.Generator) -> tuple[bool, None]:
        self._clear()
        _killed_after(self._filled(), float(random.uniform(0.2, 1.0)) * self._seconds)
        self._make_room()
        self._run()
        return self._fingerprint(self._output) == self._wanted, None

    def _make_room(self) -> None:
        """What the user does before the same command is called again: nothing."""


class _Sweep(_Resumed):
    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        words = 'sweep --runs 24 --times 0:10:11 --restitution 0.8,0.9 --task-seconds 0.2'
        command = [*_NANOROCKS, *words.split(), '--workers', '1', '-o', 'OUTPUT.npz']
        super().__init__(folder, command, _arrays)

    def _make_room(self) -> None:
        # It was finished before the kill: an existing file is not replaced.
        self._output.with_suffix('.npz').unlink(missing_ok=True)


def _arrays(path: Path) -> str:
    digest = hashlib.sha256()
    for name, array in sorted(read_archive(path.with_suffix('.npz')).items()):
        digest.update(f'{name} {array.dtype} {array.shape}'.encode() + array.tobytes())
    return digest.hexdigest()


class _Import(_Resumed):
    """`nanorocks import --each`, which continues with the films that are left."""

    def __init__(self, folder: Path) -> None:
        films = folder / 'films'
        films.mkdir(parents=True)
        for number in range(_FILMS):
            _write_film(films / f'film_{number}.avi', number)
        command = [*_NANOROCKS, 'import', str(films), '--each', '-o', 'OUTPUT']
        super().__init__(folder, command, _messages)


class _Salvage(_Resumed):
    """`nanorocks salvage`: an unfinished copy says so, and the damaged bag is not changed."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        source = folder / 'source.avi'
        _write_film(source, 9, frames=1500)
        subprocess.run(
            [*_NANOROCKS, 'import', str(source), '-o', str(folder / 'whole')],
            check=True,
            capture_output=True,
        )
        file = next((folder / 'whole').glob('*.mcap'))
        file.write_bytes(file.read_bytes()[:-2000])
        command = [*_NANOROCKS, 'salvage', str(folder / 'whole'), '-o', 'OUTPUT']
        super().__init__(folder, command, _messages)

    def _make_room(self) -> None:
        if self._output.exists():
            files = list(self._output.glob('*.mcap'))
            unfinished = not files or not open_bag(self._output).complete
            assert unfinished or self._fingerprint(self._output) == self._wanted
            shutil.rmtree(self._output)


class _Batch(_Resumed):
    """`nanorocks analyse` of several bags, which continues with those that are left."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        bags = [str(_write_bag(folder / f'bag_{number}', number)) for number in range(3)]
        command = [*_NANOROCKS, 'analyse', *bags, '--trays', '1', '--workers', '1', '-o', 'OUTPUT']
        super().__init__(folder, command, _results)


def _write_bag(path: Path, number: int) -> Path:
    """A bright square that moves over a gray tray."""
    table = {topic.absolute(): offered_topic(topic) for topic in (topics.EPOCH, topics.RAW)}
    start_ns = (1_500_000_000 + 100 * number) * NS
    with BagWriter(path, table, metadata={}) as bag:
        bag.write(topics.EPOCH.absolute(), start_ns, time_message(start_ns))
        for frame in range(60):
            pixels = np.full((210, 210), 120, np.uint8)
            pixels[50:70, 20 + frame : 40 + frame] = 200
            stamp_ns = start_ns + frame * NS // 30
            message = image_message(stamp_ns, 'camera', 'mono8', pixels)
            bag.write(topics.RAW.absolute(), stamp_ns, message)
    return path


def _results(path: Path) -> str:
    digest = hashlib.sha256()
    for table in sorted(path.rglob('*.csv')):
        digest.update(f'{table.relative_to(path)}'.encode() + table.read_bytes())
    for bag in sorted(path.rglob('results_bag')):
        for message in open_bag(bag).messages():
            digest.update(f'{message.topic} {message.log_time_ns}'.encode() + message.cdr)
    return digest.hexdigest()


def _messages(path: Path) -> str:
    digest = hashlib.sha256()
    bags = [path] if list(path.glob('*.mcap')) else sorted(path.iterdir())
    for bag in bags:
        reader = open_bag(bag)
        for message in reader.messages():
            digest.update(f'{bag.name} {message.topic} {message.log_time_ns}'.encode())
            digest.update(message.cdr)
        digest.update(b'complete' if reader.complete else b'cut')
    return digest.hexdigest()


def _write_film(path: Path, seed: int, frames: int = _FRAMES) -> None:
    import av

    random = np.random.default_rng(seed)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream('mjpeg', rate=30)
        stream.width, stream.height, stream.pix_fmt = 320, 240, 'yuvj420p'
        for number in range(frames):
            pixels = random.integers(0, 255, (240, 320, 3), dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(pixels, format='bgr24')
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


Job = _Recording | _Resumed
JOBS: dict[str, Callable[[Path], Job]] = {
    'recording': _Recording,
    'salvage': _Salvage,
    'import --each': _Import,
    'sweep': _Sweep,
    'batch': _Batch,
}
# A batch takes the longest.
ORDER = ('recording', 'salvage', 'import --each', 'sweep') * 6 + ('batch',)
