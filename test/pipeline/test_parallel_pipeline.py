"""Trays followed by processes of their own: the same records, and no process left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import astuple

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import NanorocksError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import Pipeline, Wanted
from nanorocks_ros.pipeline.parallel_pipeline import (
    SharedPipeline,
    shares_of,
    started,
    worker_count,
)
from nanorocks_ros.records import Autocorrelation, MotionMask, Notice, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values

TRAYS = (1, 3)
SETTINGS = with_values(
    PipelineSettings(),
    {'trays': TRAYS, 'preprocess.layout': 'plate', 'preprocess.pixels_per_metre': 4800.0},
    'test',
)
_NOBODY_S = 20.0


@pytest.fixture(scope='module')
def workers():
    """Two processes, which all tests share: each takes seconds to start."""
    workers = started(2)
    for worker in workers:
        worker.ready()
    yield workers
    for worker in workers:
        worker.close()


def _image(tray, number):
    rows, columns = (90, 130) if tray == 1 else (80, 120)
    color = np.full((rows, columns, 3), 150, dtype=np.uint8)
    for k in range(6):
        # Sixteenths of a pixel.
        centre = (16 * (15 + 17 * k) + 5 * number, 16 * (20 + 8 * (k % 3)) + 3 * number)
        cv2.circle(color, centre, 16 * 6, (30, 30, 200), -1, cv2.LINE_AA, 4)
    return TrayImage(
        stamp_ns=number * 33_333_333,
        tray=tray,
        gray=np.ascontiguousarray(color[:, :, 1]),
        color=color,
        cycle=1,
        cycle_start_ns=0,
        noise_power=2.0,
    )


def _frame(number):
    notice = Notice(stamp_ns=number, text='between the trays')
    return (_image(1, number), notice, _image(3, number))


def _same(record, other):
    assert type(record) is type(other)
    np.testing.assert_equal(astuple(record), astuple(other))


def test_records_are_those_of_one_process_in_the_same_order(workers):
    alone = Pipeline(SETTINGS, 'test')
    shared = SharedPipeline(SETTINGS, 'test', None, workers)
    kinds = set()
    for number in range(45):
        look = Wanted(mask=number > 20, tracks=number > 30, autocorrelation=number > 10)
        wanted = dict.fromkeys(TRAYS, look)
        expected = alone.follow(_frame(number), wanted)
        records = shared.follow(_frame(number), wanted)
        assert len(records) == len(expected)
        for record, other in zip(records, expected, strict=True):
            _same(record, other)
        kinds |= {type(record) for record in records}
    assert {MotionMask, Autocorrelation, Notice} < kinds
    for record, other in zip(shared.flush(), alone.flush(), strict=True):
        _same(record, other)


def test_other_settings_begin_afresh(workers):
    first = SharedPipeline(SETTINGS, 'test', None, workers)
    assert len(first.follow(_frame(0), {1: Wanted(mask=True)})) >= 3
    other = with_values(SETTINGS, {'clusters.interval': 0.05}, 'test')
    second = SharedPipeline(other, 'test', None, workers)
    alone = Pipeline(other, 'test')
    for number in range(5):
        counts = [len(pipeline.follow(_frame(number))) for pipeline in (second, alone)]
        assert counts[0] == counts[1]


def test_an_error_is_raised_here_and_the_next_frame_is_followed(workers):
    shared = SharedPipeline(SETTINGS, 'test', None, workers)
    shared.follow(_frame(0))
    bad = TrayImage(stamp_ns=1, tray=1, gray=np.zeros((0, 3), dtype=np.uint8))
    with pytest.raises(RuntimeError, match='Traceback'):
        shared.follow((bad, _image(3, 1)))
    fresh = SharedPipeline(SETTINGS, 'test', None, workers)
    assert len(fresh.follow(_frame(2))) >= 3


def test_a_process_that_was_killed_is_named_with_a_remedy():
    (worker,) = started(1)
    worker.ready()
    shared = SharedPipeline(SETTINGS, 'test', None, (worker,))
    shared.follow(_frame(0))
    os.kill(worker.pid, signal.SIGKILL)
    while _runs(worker.pid):
        time.sleep(0.01)
    with pytest.raises(NanorocksError, match=r'ended \(exit code -9\).*workers: 0'):
        shared.follow(_frame(1))
    worker.close()


_PARENT = """
import time
from nanorocks_ros.pipeline.parallel_pipeline import started
if __name__ == '__main__':
    (worker,) = started(1)
    print(worker.pid, flush=True)
    time.sleep(60)
"""


def test_a_process_ends_when_its_parent_is_killed(tmp_path):
    script = tmp_path / 'parent.py'
    script.write_text(_PARENT)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        # In the middle of its preparations.
        time.sleep(1.0)
        os.kill(pid, signal.SIGINT)
        os.kill(pid, signal.SIGTERM)
        assert parent.poll() is None
        assert _runs(pid)
        parent.kill()
    end = time.monotonic() + _NOBODY_S
    while _runs(pid) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _runs(pid)


def _runs(pid):
    """Whether there is such a process, one that has ended and waits to be noticed apart."""
    try:
        with open(f'/proc/{pid}/stat', encoding='utf-8') as stat:
            return stat.read().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False


def test_trays_are_shared_out_by_their_beads():
    trays = tuple(load_trays().values())
    shares = shares_of(trays, 3)
    assert sorted(tray.number for share in shares for tray in share) == [*range(1, 9)]
    loads = [sum(tray.count for tray in share) for share in shares]
    largest = max(tray.count for tray in trays)
    assert max(loads) <= max(largest, 0.5 * sum(loads))


def test_a_single_tray_needs_no_process():
    assert worker_count(-1, 1) == 0
    assert worker_count(-1, 8) == min(len(os.sched_getaffinity(0)) - 1, 4)
    assert worker_count(3, 8) == 3
    assert worker_count(3, 2) == 2
    assert worker_count(0, 8) == 0
