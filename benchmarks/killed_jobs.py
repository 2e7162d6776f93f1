"""The jobs that `python -m benchmarks kills` kills and resumes."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.file_steps import difference, digests
from benchmarks.killed_job_files import (
    arrays_of,
    messages_of,
    results_of,
    whole_folder,
    write_bag,
    write_film,
)
from nanorocks_ros.jobs.resumed_tasks import parts_folder
from nanorocks_ros.recordings.bag.reader import open_bag

if TYPE_CHECKING:
    from collections.abc import Callable

_NANOROCKS = [str(Path(sys.executable).with_name('nanorocks'))]
_LONGEST_LOSS_S = 2.0
_RECORDED_S = (1.5, 5.0)
_FILMS = 3
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
_REPRODUCTION = """
import sys
from pathlib import Path
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.studies.reproduction.campaign_plan import CampaignPlan
from nanorocks_ros.studies.reproduction.reproduce_paper import reproduce

plan = CampaignPlan(cycles=1, seconds=3.0)
reproduce(Path(sys.argv[1]), plan, Workers(processes=1), 2, lambda *_: None, lambda _: None)
"""


def _was_killed(command: list[str], seconds: float) -> bool:
    """Run a command, and kill it and all that it started unless it has ended by then."""
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
        return False
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    return True


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

    def keep(self, folder: Path) -> None:
        """Copy the recording."""
        shutil.copytree(self._bag, folder / 'bag')


class _Resumed:
    """A command that is killed, run again, and compared with one that was not.

    Parameters
    ----------
    folder : Path
        Its outputs lie in ``killed``; what they should be in ``wanted``.
    command : list of str
        OUTPUT stands for its output.
    fingerprint : callable
        Of the output, so that equal ones are bit-identical. Names of files, hidden ones too, are
        always compared.
    """

    def __init__(
        self, folder: Path, command: list[str], fingerprint: Callable[[Path], str]
    ) -> None:
        self._command, self._fingerprint = command, fingerprint
        self._killed, self._whole = folder / 'killed', folder / 'wanted'
        self._output = self._killed / 'output'
        self._killed.mkdir()
        began = time.monotonic()
        self._run()
        self._seconds = time.monotonic() - began
        self._wanted = self._state()
        shutil.copytree(self._killed, self._whole)

    def _state(self) -> tuple[str, list[str]]:
        return self._fingerprint(self._output), sorted(digests(self._killed))

    def _filled(self) -> list[str]:
        return [word.replace('OUTPUT', str(self._output)) for word in self._command]

    def _run(self) -> None:
        subprocess.run(self._filled(), check=True, capture_output=True)

    def _was_killed_after(self, seconds: float) -> bool:
        began = time.monotonic()
        if _was_killed(self._filled(), seconds):
            return True
        # It takes less time than before, as where the first run compiled functions.
        self._seconds = min(self._seconds, time.monotonic() - began)
        return False

    def _clear(self) -> None:
        shutil.rmtree(self._killed)
        self._killed.mkdir()

    def keep(self, folder: Path) -> None:
        """Copy what the last kill led to, and what it should be."""
        for source in (self._killed, self._whole):
            shutil.copytree(source, folder / source.name)
        lines = difference(digests(self._killed), digests(self._whole))
        (folder / 'differences.txt').write_text('\n'.join(lines))

    def kill(self, random: np.random.Generator) -> tuple[bool, None]:
        self._clear()
        while not self._was_killed_after(float(random.uniform(0.2, 1.0)) * self._seconds):
            self._clear()
        self._make_room()
        try:
            self._run()
        except subprocess.CalledProcessError as error:
            print(error.stderr.decode(), file=sys.stderr)
            return False, None
        return self._state() == self._wanted, None

    def _make_room(self) -> None:
        """What the user does before the same command is called again: nothing."""


class _Simulations(_Resumed):
    """Simulations that end in one archive."""

    words: str

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        command = [*_NANOROCKS, *self.words.split(), '--workers', '1', '-o', 'OUTPUT.npz']
        super().__init__(folder, command, arrays_of)

    def _make_room(self) -> None:
        # It was finished before the kill, its parts too: an existing file is not replaced.
        output = self._output.with_suffix('.npz')
        if not parts_folder(output).exists():
            output.unlink(missing_ok=True)


class _Sweep(_Simulations):
    words = 'sweep --runs 24 --times 0:10:11 --restitution 0.8,0.9 --task-seconds 0.2'


class _Library(_Simulations):
    words = 'library --tray 1 --nodes 254 --rough-nodes 0 --runs 12'


class _Import(_Resumed):
    """`nanorocks import --each`, which continues with the films that are left."""

    def __init__(self, folder: Path) -> None:
        films = folder / 'films'
        films.mkdir(parents=True)
        for number in range(_FILMS):
            write_film(films / f'film_{number}.avi', number)
        command = [*_NANOROCKS, 'import', str(films), '--each', '-o', 'OUTPUT']
        super().__init__(folder, command, messages_of)


class _Salvage(_Resumed):
    """`nanorocks salvage`: an unfinished copy says so, and the damaged bag is not changed."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        source = folder / 'source.avi'
        write_film(source, 9, frames=1500)
        subprocess.run(
            [*_NANOROCKS, 'import', str(source), '-o', str(folder / 'whole')],
            check=True,
            capture_output=True,
        )
        file = next((folder / 'whole').glob('*.mcap'))
        file.write_bytes(file.read_bytes()[:-2000])
        command = [*_NANOROCKS, 'salvage', str(folder / 'whole'), '-o', 'OUTPUT']
        super().__init__(folder, command, messages_of)

    def _make_room(self) -> None:
        if self._output.exists():
            files = list(self._output.glob('*.mcap'))
            unfinished = not files or not open_bag(self._output).complete
            assert unfinished or self._fingerprint(self._output) == self._wanted[0]
            shutil.rmtree(self._output)


class _Batch(_Resumed):
    """`nanorocks analyse` of several bags, which continues with those that are left."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        bags = [str(write_bag(folder / f'bag_{number}', number)) for number in range(3)]
        command = [*_NANOROCKS, 'analyse', *bags, '--trays', '1', '--workers', '1', '-o', 'OUTPUT']
        super().__init__(folder, command, results_of)


class _Reproduction(_Resumed):
    """What `nanorocks reproduce` calls, with two films of 3 s, which it never makes so short."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        super().__init__(folder, [sys.executable, '-c', _REPRODUCTION, 'OUTPUT'], whole_folder)


Job = _Recording | _Resumed
JOBS: dict[str, Callable[[Path], Job]] = {
    'recording': _Recording,
    'salvage': _Salvage,
    'import --each': _Import,
    'sweep': _Sweep,
    'library': _Library,
    'batch': _Batch,
    'reproduce': _Reproduction,
}
# A batch and a reproduction take the longest.
ORDER = ('recording', 'salvage', 'import --each', 'sweep', 'library') * 4 + ('batch', 'reproduce')
