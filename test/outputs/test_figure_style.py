"""The style of the figures: colours, ticks and scale bars."""

from __future__ import annotations

import itertools
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

import nanorocks_ros
from nanorocks_ros.outputs import figure_style
from nanorocks_ros.outputs.figure_style import SERIES, STYLE, bar_length, plain_numbers, scale_bar

SOURCES = sorted(Path(nanorocks_ros.__file__).parent.rglob('*.py'))
# How people without the green receptor see linear rgb: Viénot, Brettel and Mollon 1999.
DEUTERANOPE = np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1]])


def seen(colour):
    linear = DEUTERANOPE @ np.array(mpl.colors.to_rgb(colour)) ** 2.2
    return np.clip(linear, 0.0, 1.0) ** (1.0 / 2.2)


def test_colours_differ_for_those_who_do_not_see_green():
    distances = [np.linalg.norm(seen(a) - seen(b)) for a, b in itertools.combinations(SERIES, 2)]
    assert min(distances) > 0.15


def test_no_figure_has_a_rainbow_or_a_writer_of_its_own():
    for path in SOURCES:
        text = path.read_text(encoding='utf-8')
        assert not any(f"'{name}'" in text for name in ('jet', 'turbo', 'rainbow', 'hsv')), path
        if path.name != 'figure_files.py':
            assert '.savefig(' not in text, path


@pytest.mark.parametrize(
    ('ends', 'shown'),
    [
        ((0.8, 40.0), {1.0, 2.0, 5.0, 10.0, 20.0}),
        ((3.0, 9.0), {3.0, 4.0, 5.0, 7.0}),
        ((0.9, 1.1), {0.92, 1.0, 1.08}),
        # Every power of ten, or every second: releases of Matplotlib differ.
        ((1e-4, 1e3), set()),
    ],
)
def test_a_logarithmic_axis_has_round_numbers_whatever_its_length(ends, shown):
    axes = Figure().subplots()
    axes.set_xscale('log')
    plain_numbers(axes.xaxis)
    axes.set_xlim(*ends)
    ticks = [tick for tick in axes.get_xticks() if ends[0] <= tick <= ends[1]]
    assert 2 < len(ticks) < 12
    assert all(np.isclose(ticks, tick).any() for tick in shown)
    assert not any('10^' in label.get_text() for label in axes.get_xticklabels())


def test_a_scale_bar_has_the_length_that_it_names():
    axes = Figure().subplots()
    axes.imshow(np.zeros((100, 200)))
    length = scale_bar(axes, units_per_mm=4.0)
    assert length == bar_length(50.0) == 10.0
    (bar,) = axes.lines
    assert np.ptp(bar.get_xdata()) == pytest.approx(40.0)
    assert axes.texts[0].get_text() == '10 mm'


def test_the_style_asks_for_letters_of_truetype():
    assert STYLE['pdf.fonttype'] == 42
    assert STYLE['savefig.dpi'] == 200
    assert figure_style.MAP in {'viridis', 'cividis'}
