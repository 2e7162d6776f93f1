"""Cost of the live page: frames, latency and CPU with 0, 1, 10 and 10 slow browsers.

One `pipeline` films and measures a tray of elastic beads, which never cool, at 1080p and 30 Hz.
`dashboard` and the browsers, which view the tray with tracks and moving areas, run in separate
processes. A browser acknowledges every step; a slow one opens the connection, requests images and
reads nothing. All stages are measured in one run; ratios are relative to the mean of the first and
the last stage, which have no page. CPU of the pipeline is per frame, since a busy machine
processes late frames later.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.live import listener, spin, start_node

_SECONDS = float(os.environ.get('DASHBOARD_SECONDS', '20'))
_PAUSE_S = 4.0
_SETTLE_S = 120.0
_DOMAIN = '59'
_TICKS = os.sysconf('SC_CLK_TCK')
_LOOK = {'look': {'tray': 1, 'layers': ['tracks', 'motion']}}
_BROWSERS = 'from benchmarks.dashboard import browse; browse({}, {}, {}, {})'


class _Stage(NamedTuple):
    """Measurements of one stage."""

    frames: float
    median_ms: float
    late_ms: float
    cpu: float
    page_cpu: float
    page_mb: float
    steps: float
    pictures: float


class _Frames:
    """Times at which each frame was sent and processed."""

    def __init__(self, node) -> None:
        from nanorocks_ros.wire import topics

        self.sent: dict[float, float] = {}
        self.done: dict[float, float] = {}
        node.listen(topics.TRUTH, self._note(self.sent), 1, required=False)
        node.listen(topics.STATE, self._note(self.done), 1, required=False)

    @staticmethod
    def _note(times: dict[float, float]):
        def record_time(message) -> None:
            times[round(message.data[0], 4)] = time.monotonic()

        return record_time

    def clear(self) -> None:
        self.sent.clear()
        self.done.clear()


def browse(port: int, quick: int, slow: int, seconds: float) -> None:
    """Run browsers for some seconds; print the steps and images per second of a quick one."""
    print(json.dumps(asyncio.run(_browse(port, quick, slow, seconds))))


async def _browse(port: int, quick: int, slow: int, seconds: float) -> list[float]:
    import aiohttp

    async with aiohttp.ClientSession() as session:
        url = f'http://127.0.0.1:{port}/live'
        for _ in range(slow):
            await (await session.ws_connect(url)).send_json(_LOOK)
        counts = await asyncio.gather(*(_browser(session, url, seconds) for _ in range(quick)))
        await asyncio.sleep(0.0 if quick else seconds)
    return (
        [float(np.mean(values)) for values in zip(*counts, strict=True)] if counts else [0.0, 0.0]
    )


async def _browser(session, url: str, seconds: float) -> tuple[float, float]:
    import aiohttp

    steps = pictures = 0
    deadline = time.monotonic() + seconds
    async with session.ws_connect(url) as connection:
        await connection.receive()
        await connection.send_json(_LOOK)
        while time.monotonic() < deadline:
            message = await connection.receive()
            if message.type is aiohttp.WSMsgType.BINARY:
                pictures += 1
                continue
            steps += 1
            await connection.send_json({'seen': json.loads(message.data)['n']})
    return steps / seconds, pictures / seconds


def _cpu(process: subprocess.Popen | None) -> float:
    if process is None:
        return 0.0
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def _memory_mb(process: subprocess.Popen | None) -> float:
    if process is None:
        return 0.0
    status = Path(f'/proc/{process.pid}/status').read_text()
    return int(re.findall(r'VmRSS:\s+(\d+)', status)[0]) / 1024


def _measure(executor, frames, pipeline, page, port, quick, slow) -> _Stage:
    browsers = None
    if quick or slow:
        call = _BROWSERS.format(port, quick, slow, _SECONDS + 2 * _PAUSE_S)
        browsers = subprocess.Popen([sys.executable, '-c', call], stdout=subprocess.PIPE)
    spin(executor, _PAUSE_S)
    frames.clear()
    before, start = [_cpu(pipeline), _cpu(page)], time.monotonic()
    spin(executor, _SECONDS)
    used = np.subtract([_cpu(pipeline), _cpu(page)], before) / (time.monotonic() - start)
    late = [1e3 * (frames.done[k] - at) for k, at in frames.sent.items() if k in frames.done]
    memory = _memory_mb(page)
    got = json.loads(browsers.communicate()[0]) if browsers else [0.0, 0.0]
    return _Stage(
        len(frames.done) / _SECONDS, float(np.median(late)), float(np.quantile(late, 0.99)),
        used[0], used[1], memory, *got,
    )  # fmt: skip


def report() -> None:
    """Run all stages and print their table."""
    with listener(_DOMAIN) as (node, executor):
        _print(_stages(node, executor))


def _stages(node, executor) -> dict[str, _Stage]:
    frames = _Frames(node)
    pipeline = start_node(
        'pipeline', '--ros-args', '-p', 'simulation.restitution:=1.0',
        '-p', 'simulation.wall_restitution:=1.0', '-p', 'simulation.shake_period:=3600.0',
    )  # fmt: skip
    spin(executor, _SETTLE_S, lambda: len(frames.done) > 60)
    stages = {'no page': _measure(executor, frames, pipeline, None, 0, 0, 0)}
    page = start_node(
        'dashboard', '--ros-args', '-p', 'port:=0', stdout=subprocess.PIPE, text=True
    )
    port = int(re.findall(r':(\d+)/', page.stdout.readline())[0])
    for name, quick, slow in (
        ('no browser', 0, 0),
        ('1 browser', 1, 0),
        ('10 browsers', 10, 0),
        ('10, and 10 slow', 10, 10),
    ):
        stages[name] = _measure(executor, frames, pipeline, page, port, quick, slow)
    stages['no page again'] = _last(executor, frames, pipeline, page)
    pipeline.send_signal(2)
    pipeline.wait(10)
    return stages


def _last(executor, frames, pipeline, page) -> _Stage:
    page.send_signal(2)
    page.wait(10)
    return _measure(executor, frames, pipeline, None, 0, 0, 0)


def _print(stages: dict[str, _Stage]) -> None:
    per_frame = {name: 1e3 * stage.cpu / stage.frames for name, stage in stages.items()}
    alone = 0.5 * (per_frame['no page'] + per_frame['no page again'])
    print(
        '| stage | frames/s | latency, median [ms] | p99 [ms] | CPU of the pipeline per frame '
        '[ms] | ratio | CPU of the page [cores] | memory of the page [MB] | steps/s | pictures/s |'
    )
    print('|' + ' --- |' * 10)
    for name, stage in stages.items():
        print(
            f'| {name} | {stage.frames:.1f} | {stage.median_ms:.1f} | {stage.late_ms:.1f} '
            f'| {per_frame[name]:.1f} | {per_frame[name] / alone:.2f} | {stage.page_cpu:.2f} '
            f'| {stage.page_mb:.0f} | {stage.steps:.1f} | {stage.pictures:.1f} |'
        )
