"""Trays with next to nothing in them, through all stages."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline.composition import TrayStages
from nanorocks_ros.records import (
    ClusterEstimate,
    CorEstimate,
    Merge,
    SizeStatus,
    SpeedEstimate,
    StickingStatus,
    TrayImage,
)
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

FLOWN = load_trays()[1]
# There is no library of simulated decays of such a tray.
SETTINGS = with_values(PipelineSettings(), {'cooling.relation': 'paper'}, 'test')


def records_of(stages, images):
    return [*(record for image in images for record in stages.push(image)), *stages.flush()]


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('beads', [1, 2])
def test_of_one_or_two_beads_there_is_a_speed_and_nothing_confident_else(beads):
    tray = replace(FLOWN, species=(replace(FLOWN.species[0], count=beads),))
    simulation = SimulationSettings(width_px=210, height_px=210, first_shake=0.5, seed=3)
    stage = Preprocessor(SETTINGS, {1: tray}, 'test')
    images = [
        record
        for frame, _ in film(simulation, tray, 150)
        for record in stage.push(frame)
        if isinstance(record, TrayImage)
    ]
    records = records_of(TrayStages(SETTINGS, tray), images)
    assert any(isinstance(record, SpeedEstimate) for record in records)
    assert not any(isinstance(record, Merge) for record in records)
    for item in records:
        if isinstance(item, CorEstimate) and not math.isnan(item.restitution.value):
            assert item.restitution.lower <= item.restitution.value <= item.restitution.upper
        if isinstance(item, ClusterEstimate):
            assert not item.bodies.value > beads
            assert item.sticking_status in (StickingStatus.UNKNOWN, StickingStatus.NO_MERGE)


@pytest.mark.filterwarnings('error')
def test_of_an_empty_tray_nothing_is_said():
    rng = np.random.default_rng(1)
    images = []
    for k in range(200):
        color = rng.integers(118, 122, (180, 180, 3), dtype=np.uint8)
        shaken = k > 15
        images.append(
            TrayImage(
                stamp_ns=round(k * 1e9 / 30),
                tray=1,
                gray=np.ascontiguousarray(color[:, :, 0]),
                color=color,
                cycle=int(shaken),
                cycle_start_ns=500_000_000 if shaken else None,
                noise_power=2.0,
            )
        )
    records = records_of(TrayStages(PipelineSettings(), FLOWN), images)
    clusters = [record for record in records if isinstance(record, ClusterEstimate)]
    assert clusters
    for cluster in clusters:
        assert cluster.size_status is SizeStatus.NOTHING
        assert math.isnan(cluster.combined_size.value)
        assert math.isnan(cluster.bodies.value)
        assert cluster.sticking_status is StickingStatus.UNKNOWN
    assert not any(isinstance(record, Merge) for record in records)
    assert all(
        math.isnan(record.restitution.value)
        for record in records
        if isinstance(record, CorEstimate)
    )
