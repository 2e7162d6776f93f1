"""The picture of simulated runs."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from picture_colours import colours_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.synthetic.simulated_figure import simulated_figure
from nanorocks_ros.studies.synthetic.simulated_plan import SimulationPlan
from nanorocks_ros.studies.synthetic.simulated_runs import simulate

# In blue, green, red.
MEAN, MARK = (0x00, 0x5E, 0xD5), (0, 0, 0)


def drawn(path, tray=1, samples=51, runs=3, **settings):
    plan = SimulationPlan(
        settings=replace(SimulationSettings(), tray=tray, **settings),
        tray=load_trays()[tray],
        duration=10.0,
        samples=samples,
        runs=runs,
        picture=True,
    )
    simulated_figure(path, simulate(plan, Workers(processes=1)))
    return cv2.imread(str(path))


@pytest.mark.parametrize('tray', [1, 3])
def test_beads_and_decay_are_drawn(tmp_path, tray):
    picture = drawn(tmp_path / 'tray.png', tray)
    assert min(picture.shape[:2]) > 600
    assert {MEAN, MARK} <= colours_of(picture)
    # Beads in the colours of their speeds fill a good part of the trays.
    upper = picture[: picture.shape[0] // 2]
    coloured = upper.max(axis=2).astype(int) - upper.min(axis=2) > 60
    assert coloured.mean() > 0.05
    assert [path.name for path in tmp_path.iterdir()] == ['tray.png']


def test_beads_at_rest_and_two_times_are_drawn_too(tmp_path):
    picture = drawn(tmp_path / 'rest.png', samples=2, runs=1, mean_speed=0.0)
    assert np.ptp(picture) > 200
