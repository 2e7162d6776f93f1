"""A scale that beads and walls contradict reaches speeds, restitutions and the user."""

from __future__ import annotations

import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import Pipeline
from nanorocks_ros.records import CorEstimate, CorStatus, Notice, Quality, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film

TRUE = 13500.0


@pytest.fixture(scope='module')
def frames():
    values = {'width_px': 240, 'height_px': 240, 'first_shake': 0.5, 'seed': 3}
    settings = with_values(SimulationSettings(), values, 'test')
    return [frame for frame, _ in film(settings, load_trays()[1], 360)]


def results_of(frames, told):
    # The check of the positions is off: only the rulers of the scale tell.
    values = {'preprocess.pixels_per_metre': told, 'preprocess.check_tray_positions': False}
    pipeline = Pipeline(with_values(PipelineSettings(), values, 'test'), 'cam')
    records = [record for frame in frames for record in pipeline.push(frame)]
    return [*records, *pipeline.flush()]


def of(results, kind):
    return [record for record in results if isinstance(record, kind)]


def test_no_restitution_is_given_at_a_scale_that_is_nine_percent_too_high(frames):
    results = results_of(frames, 1.09 * TRUE)
    final = of(results, CorEstimate)[-1]
    assert final.status is CorStatus.UNDETERMINED
    assert final.quality & Quality.WRONG_SCALE
    (notice,) = of(results, Notice)
    advised = float(notice.text.split('--preprocess-pixels-per-metre ')[1])
    assert advised == pytest.approx(TRUE, rel=0.01)


def test_a_restitution_at_a_scale_that_is_three_percent_too_high_is_flagged(frames):
    results = results_of(frames, 1.035 * TRUE)
    final = of(results, CorEstimate)[-1]
    assert final.quality & Quality.DOUBTFUL_SCALE
    assert of(results, SpeedEstimate)[-1].quality & Quality.DOUBTFUL_SCALE
    assert len(of(results, Notice)) == 1


def test_a_scale_that_is_right_leaves_no_flag(frames):
    results = results_of(frames, TRUE)
    doubts = Quality.WRONG_SCALE | Quality.DOUBTFUL_SCALE
    estimates = of(results, SpeedEstimate | CorEstimate)
    assert estimates
    assert not any(estimate.quality & doubts for estimate in estimates)
    assert of(results, Notice) == []
