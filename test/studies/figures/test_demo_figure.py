"""The figure of a cooling cycle, and the picture of the README, which is that of the demo."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from picture_colours import colours_of

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_style import FITTED, MEASURED
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.studies.analysis.offline_analysis import analyse
from nanorocks_ros.studies.figures.demo_figure import cooling_figure

ROOT = Path(__file__).parents[3]
# The tray that the demo simulates, with the same seed, recorded as JPEGs.
SAMPLE, README = ROOT / 'bags' / 'tray_1_sample', ROOT / 'docs' / 'pictures' / 'demo.png'
RENEW = 'NANOROCKS_RENEW_PICTURES'
# Letters and antialiasing differ a little between versions of Matplotlib.
SIZE, TOLERANCE = (120, 104), 12.0


@pytest.fixture(scope='module')
def picture(tmp_path_factory):
    results = analyse(SAMPLE, PipelineSettings()).trays[1]
    path = tmp_path_factory.mktemp('demo') / 'cooling.png'
    speeds = [speed for speed in results.speeds if speed.cycle == 1]
    truth = [state for state in results.truth if state.cycle == 1]
    cooling_figure(path, load_trays()[1], speeds, results.cors, truth)
    return path


def bgr(colour):
    return tuple(round(255 * part) for part in to_rgb(colour))[::-1]


def small(path):
    return cv2.resize(cv2.imread(str(path)), SIZE, interpolation=cv2.INTER_AREA).astype(float)


def test_the_figure_of_a_cycle_is_drawn(picture):
    pixels = cv2.imread(str(picture))
    assert min(pixels.shape[:2]) > 500
    assert {bgr(MEASURED), bgr(FITTED)} <= colours_of(pixels)


def test_the_picture_of_the_readme_is_that_of_the_demo(picture):
    """With NANOROCKS_RENEW_PICTURES=1 it is renewed instead."""
    if os.environ.get(RENEW):
        README.write_bytes(picture.read_bytes())
    assert cv2.imread(str(README)).shape == cv2.imread(str(picture)).shape
    difference = np.abs(small(README) - small(picture))
    assert difference.max() < TOLERANCE, f'stale: run this test with {RENEW}=1'
    assert b'make demo' in README.read_bytes()
