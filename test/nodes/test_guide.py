"""The commands of the guide work, in order, in a folder of their own."""

from __future__ import annotations

import itertools
import os
import re
import signal
import subprocess
import sys
from fractions import Fraction

import pytest

pytest.importorskip('rclpy')

from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.wire import topics

# Frames of the sample bag: it rests, is shaken after a second, and cools.
FRAMES, FEW_FRAMES = 300, 90
PATIENCE_S = 180
MARK = re.compile(r'^<!-- (not run: .+|goes on|Ctrl-C) -->$')


def commands(text):
    """Marks and indented blocks of a page, in order: (mark or '', block or '')."""
    mark, block, marked = '', [], []
    for line in [*text.splitlines(), 'end']:
        if line.startswith('    ') or (block and not line):
            block.append(line[4:])
            continue
        if block:
            marked.append((mark, '\n'.join(block).rstrip() + '\n'))
            mark, block = '', []
        if MARK.match(line):
            mark = MARK.match(line).group(1)
        if mark == 'Ctrl-C':
            marked.append((mark, ''))
            mark = ''
    return marked


def make_film(path, bag, frames):
    """A video of the first frames of a bag, as an old camera stores it."""
    av = pytest.importorskip('av')
    reader = open_bag(bag)
    messages = reader.messages([topics.RAW_COMPRESSED.absolute()])
    with av.open(str(path), 'w') as film:
        stream = film.add_stream('mjpeg', rate=30)
        stream.width = stream.height = 208
        stream.pix_fmt = 'yuvj420p'
        for number, message in enumerate(itertools.islice(messages, frames)):
            packet = av.Packet(bytes(reader.deserialize(message).data))
            packet.stream, packet.time_base = stream, Fraction(1, 30)
            packet.pts = packet.dts = number
            film.mux(packet)


class Shell:
    """Runs blocks in a folder, with the environment of the guide."""

    def __init__(self, folder, domain):
        self._folder = folder
        self._going_on = []
        self._environment = {
            **os.environ,
            'PATH': f'{sys.prefix}/bin:{os.environ["PATH"]}',
            'AMENT_PREFIX_PATH': sys.prefix,
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(domain),
            'OPENBLAS_NUM_THREADS': '1',
        }

    def _start(self, block):
        log = (self._folder / 'log').open('w+')
        process = subprocess.Popen(
            ['bash', '-e', '-o', 'pipefail', '-c', block],
            cwd=self._folder,
            env=self._environment,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        return process, log

    def run(self, block):
        process, log = self._start(block)
        try:
            process.wait(PATIENCE_S)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
        log.seek(0)
        output = log.read()
        assert process.returncode == 0, f'{block}{output}'
        return output

    def go_on(self, block):
        self._going_on.append(self._start(block))

    def interrupt(self):
        """Press Ctrl-C in the shells that go on."""
        for process, log in self._going_on:
            os.killpg(process.pid, signal.SIGINT)
            code = process.wait(PATIENCE_S)
            log.seek(0)
            assert code == 0, log.read()
        self._going_on = []

    def end(self):
        for process, _ in self._going_on:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def test_the_guide_does_what_it_says(root, tmp_path, domain):
    make_film(tmp_path / 'film.avi', root / 'bags/tray_1_sample', FRAMES)
    (tmp_path / 'videos').mkdir()
    for name in ('run 1.avi', 'läuft.avi'):
        make_film(tmp_path / 'videos' / name, root / 'bags/tray_1_sample', FEW_FRAMES)
    shell = Shell(tmp_path, domain)
    outputs = {}
    try:
        for mark, block in commands((root / 'docs/start/guide.md').read_text(encoding='utf-8')):
            if mark == 'Ctrl-C':
                shell.interrupt()
            elif mark == 'goes on':
                shell.go_on(block)
            elif not mark:
                outputs[block.splitlines()[-1]] = shell.run(block)
    finally:
        shell.end()
    assert re.search(r'cycle 1: COR 0\.\d+', outputs['nanorocks analyse my_film'])
    assert '/nanorocks/tray_1/cor' in outputs['nanorocks info rehearsal']
    assert '/nanorocks/pipeline' in outputs['nanorocks doctor --graph']
    quick = outputs['nanorocks measure film.avi --diameter-px 27 -o quick']
    assert re.search(r'15\.\d beads seen.*: usable', quick)
    assert re.search(r'walls, by rebounds alone: 0\.9\d+', quick)
    measured = outputs['nanorocks measure film.avi --trays-file mine.yaml -o measured']
    assert 'library: ' not in measured, 'the library of the package is of this tray'
    assert re.search(r'decay: cycle 1: COR 0\.\d+', measured)
    files = ('quick/report.html', 'measured/report.html', 'my_film_results/tray_1_cor.csv')
    for made in ('steps.png', 'decay.png', 'mine.png', *files):
        assert (tmp_path / made).stat().st_size > 0
    report = (tmp_path / 'results/report.html').read_text(encoding='utf-8')
    assert 'run 1' in report
    assert 'läuft' in report


def test_commands_of_a_page_are_found_with_their_marks():
    page = 'text\n\n    one\n    two\n\n<!-- not run: why -->\n\n    three\n\n<!-- Ctrl-C -->\n'
    assert commands(page) == [('', 'one\ntwo\n'), ('not run: why', 'three\n'), ('Ctrl-C', '')]
