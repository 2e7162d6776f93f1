"""The figure of a cooling cycle."""

from __future__ import annotations

from pathlib import Path

import cv2
from matplotlib.colors import to_rgb

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.figures.demo_figure import cooling_figure


def bgr(colour):
    return tuple(round(255 * part) for part in to_rgb(colour))[::-1]


SAMPLE = Path(__file__).parents[3] / 'bags' / 'tray_1_sample'


def test_the_figure_of_a_cycle_is_drawn(tmp_path):
    results = analyse(SAMPLE, PipelineSettings()).trays[1]
    path = tmp_path / 'cooling.png'
    speeds = [speed for speed in results.speeds if speed.cycle == 1]
    truth = [state for state in results.truth if state.cycle == 1]
    cooling_figure(path, load_trays()[1], speeds, results.cors, truth)
    picture = cv2.imread(str(path))
    assert min(picture.shape[:2]) > 500
    # Colours of the measured points and of the fit.
    colours = {tuple(state) for state in picture.reshape(-1, 3)[::7].tolist()}
    assert {bgr(MEASURED), bgr(FITTED)} <= colours
