"""The paper's table 3, its linear calibration, and its rule for the onset."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, FitError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.paper_clusters import PAPER_TABLE_3, paper_calibration, paper_onset

VALUES = json.loads((Path(__file__).parents[1] / 'paper_values.json').read_text('utf-8'))


def test_table_3_is_the_papers():
    for tray, row in VALUES['table3_clusters']['rows'].items():
        manual = PAPER_TABLE_3[int(tray)]
        assert [manual.clusters, manual.beads_per_cluster, manual.deviation] == row[:3]
        assert 100.0 * manual.share == pytest.approx(row[3])


@pytest.mark.parametrize('tray', [1, 2, 3, 5])
def test_where_all_beads_are_seen_its_columns_agree_with_each_other(tray):
    row = PAPER_TABLE_3[tray]
    share = row.clusters * row.beads_per_cluster / load_trays()[tray].count
    assert share == pytest.approx(row.share, abs=0.002)


def test_the_calibration_returns_what_was_counted_for_the_mean_area():
    calibration = paper_calibration(np.array([1e-6, 2e-6, 3e-6, np.nan]), 5.52)
    assert calibration.size(np.array([2e-6])) == pytest.approx([5.52])
    assert calibration.beads_per_area_error / calibration.beads_per_area == pytest.approx(
        0.5 / math.sqrt(3.0)
    )
    # It knows no saturation: twice the area, twice the size.
    assert calibration.size(np.array([8e-6])) == pytest.approx([4 * 5.52])


@pytest.mark.parametrize(('areas', 'size'), [([np.nan], 5.0), ([], 5.0), ([1e-6], 0.0)])
def test_a_calibration_without_areas_or_counts_is_refused(areas, size):
    with pytest.raises(ConfigurationError, match='give the level areas at the end of cycles'):
        paper_calibration(np.array(areas), size)


def test_the_onset_is_the_first_growth_after_the_shake():
    times = np.arange(0.0, 3.0, 0.2)
    sizes = np.where(times < 1.5, 2.0 - times, times)
    sizes[0] = 0.0
    assert paper_onset(times, sizes, start=0.2) == pytest.approx(1.5, abs=0.11)
    assert math.isnan(paper_onset(times, -times))


def test_the_rule_triggers_on_noise():
    generator = np.random.default_rng(4)
    times = np.arange(0.0, 20.0, 0.2)
    fired = [paper_onset(times, 1.0 + 0.03 * generator.normal(size=100)) for _ in range(20)]
    assert np.isfinite(fired).all()
    assert np.median(fired) < 1.0


def test_one_picture_is_too_few_for_an_onset():
    with pytest.raises(FitError, match='1 cluster sizes after 1 s'):
        paper_onset(np.array([0.0, 0.5, 1.5]), np.ones(3), start=1.0)
