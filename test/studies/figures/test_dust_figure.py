"""Names of trays beside points that lie close together."""

from __future__ import annotations

import itertools

import pytest
from matplotlib.text import Text

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.figure_files import figure_file
from nanorocks_ros.outputs.figure_style import TWO_COLUMNS
from nanorocks_ros.studies.figures.dust_figure import (
    name_trays,
    paper_thresholds,
    threshold_of_tray,
)


@pytest.mark.parametrize('numbers', [(1,), (1, 3, 5), tuple(range(1, 9))], ids=str)
def test_names_of_trays_do_not_overlap(tmp_path, numbers):
    trays = load_trays()
    measured = [threshold_of_tray(trays[number], 0.006, (0.005, 0.007)) for number in numbers]
    with figure_file(tmp_path / 'names.png', TWO_COLUMNS, 130.0) as figure:
        axes = figure.subplots()
        axes.set(xscale='log', yscale='log', xlim=(1e-4, 1e3), ylim=(0.02, 2000.0))
        name_trays(axes, [*measured, *paper_thresholds(trays)])
        figure.draw_without_rendering()
        boxes = [Text.get_window_extent(text) for text in axes.texts]  # without its line
        named = ' '.join(text.get_text() for text in axes.texts)
        frame = axes.get_window_extent()
    assert all(str(number) in named for number in numbers)
    assert not any(first.overlaps(second) for first, second in itertools.combinations(boxes, 2))
    assert all(frame.x0 < box.x0 and box.x1 < frame.x1 for box in boxes)
