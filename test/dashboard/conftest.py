"""The live page fed with what the sample bag holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from nanorocks_ros.dashboard.board import Board
from nanorocks_ros.dashboard.server import PageServer
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import DashboardSettings, PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse

SAMPLE = Path(__file__).parents[2] / 'bags' / 'tray_1_sample'


@dataclass
class Results:
    """What was measured in the sample bag, in the order in which it came."""

    speeds: tuple
    clusters: tuple
    cors: tuple

    @property
    def all(self):
        return (*self.speeds, *self.clusters, *self.cors)


@pytest.fixture(scope='session')
def results():
    analysis = analyse(SAMPLE, PipelineSettings())
    tray = analysis.trays[1]
    results = (tray.speeds, tray.clusters, tray.cors)
    return Results(*(tuple(_since(analysis.epoch_ns, one) for one in some) for some in results))


def _since(epoch_ns, record):
    """The record with the time that the topics have, which counts from the epoch."""
    changes = {'stamp_ns': record.stamp_ns - epoch_ns}
    if getattr(record, 'cycle_start_ns', None) is not None:
        changes['cycle_start_ns'] = record.cycle_start_ns - epoch_ns
    return replace(record, **changes)


@pytest.fixture
def serve():
    """Start servers; they end with the test."""
    started = []

    def start(namespace='/nanorocks', trays=None, **settings):
        settings = DashboardSettings(**{'port': 0, 'picture_rate': 30.0, **settings})
        server = PageServer(settings, Board(trays or load_trays()), namespace)
        started.append(server)
        server.start()
        return server

    yield start
    for server in started:
        server.stop()
