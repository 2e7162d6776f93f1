"""Packing over a cycle: simulated with the truth, and from results of an analysis."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from cluster_tables import write_results

from nanorocks_ros.errors import RecordingError, SimulationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.physics.filling_factor import PAPER_CLUSTER_SIZES
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.analysis.cluster_packing import (
    PackingCurve,
    compaction,
    measured_packing,
    paper_filling_of_level_area,
)
from nanorocks_ros.studies.analysis.simulated_packing import simulated_packing

TRAY = load_trays()[1]
STICKING = SimulationSettings(
    wall_restitution=0.97,
    mean_speed=0.010,
    sticking_speed=0.0104,
    aggregate_motion='translating',
    shake_period=20.0,
    seed=2,
)


def curve(areas, fillings=None, step=1.0):
    areas = np.asarray(areas, dtype=float)
    nothing = np.full(areas.size, math.nan)
    return PackingCurve(
        tray=1,
        cycle=1,
        times=step * np.arange(areas.size),
        level_area=areas,
        beads=nothing,
        filling=nothing if fillings is None else np.asarray(fillings, dtype=float),
        paper=nothing,
        in_space=nothing,
    )


@pytest.fixture(scope='module')
def simulated():
    return simulated_packing(TRAY, STICKING, 2)


def test_compaction_is_that_of_the_widest_against_the_end():
    areas = np.full(40, 1.0)
    areas[:4], areas[10:14] = 0.5, 1.066
    fillings = np.linspace(0.3, 0.6, 40)
    result = compaction(curve(areas, fillings))
    assert result.apparent == pytest.approx(0.066)
    assert 0.3 < result.true < 0.8


def test_a_width_that_only_grows_is_no_compaction():
    assert compaction(curve(np.linspace(1.0, 2.0, 40))).apparent == pytest.approx(0.0)


def test_values_that_scatter_alone_look_like_compaction():
    rng = np.random.default_rng(1)
    compactions = [compaction(curve(1 + 0.05 * rng.normal(size=60))).apparent for _ in range(40)]
    assert np.mean(compactions) > 0.04


def test_a_cycle_that_is_too_short_is_refused():
    with pytest.raises(RecordingError, match='4 s of autocorrelations'):
        compaction(curve(np.ones(5)))


def test_pictures_without_content_are_refused():
    with pytest.raises(RecordingError, match='uniform'):
        compaction(curve(np.zeros(40)))


def test_rigid_clusters_seem_to_become_compact_but_do_not(simulated):
    assert [packing.cycle for packing in simulated] == [1, 2]
    for packing in simulated:
        result = compaction(packing)
        assert packing.beads[-1] == 15
        # Merges make them more open, and nothing makes them closer.
        assert result.true < 0.02
        assert result.apparent > 0.01
        # The formula of the paper is twice that of a layer, which is more than that in space.
        assert packing.paper[-1] == pytest.approx(2 * packing.filling[-1])
        assert packing.in_space[-1] < packing.filling[-1] < 0.6046


def test_a_shaking_event_sets_beads_apart_and_pictures_know_it(simulated):
    for packing in simulated:
        assert packing.times[0] == 0.0
        assert not packing.beads[0] > 3
        assert packing.level_area[0] < packing.level_area[-1]


def test_the_same_seed_gives_the_same_numbers(simulated):
    again = simulated_packing(TRAY, STICKING, 1)
    assert np.array_equal(again[0].level_area, simulated[0].level_area)
    assert np.array_equal(again[0].filling, simulated[0].filling, equal_nan=True)


def test_no_cycle_is_refused():
    with pytest.raises(SimulationError, match='1 or more'):
        simulated_packing(TRAY, STICKING, 0)


def test_a_gas_that_does_not_stick_has_no_filling_factor():
    curves = simulated_packing(TRAY, replace(STICKING, sticking_speed=0.0), 1)
    assert np.isnan(curves[0].filling).all()
    assert math.isnan(compaction(curves[0]).true)


def test_results_of_an_analysis_are_read_by_cycle(tmp_path):
    areas = 1e-6 * np.linspace(1.0, 2.0, 60)
    curves = measured_packing(write_results(tmp_path / 'r', areas), 1)
    assert [packing.cycle for packing in curves] == [1, 2]
    assert curves[1].times[:2].tolist() == [0.0, 1.0]
    assert curves[1].level_area == pytest.approx(areas)


def test_results_without_a_shaking_event_are_refused(tmp_path):
    with pytest.raises(RecordingError, match='after a shaking event'):
        measured_packing(write_results(tmp_path / 'r', [], starts=()), 1)


def test_a_level_area_becomes_that_of_beads_by_what_single_beads_have():
    # As wide as single beads: the area of one bead, and in it as many as were counted by hand.
    filling = paper_filling_of_level_area(TRAY, 1e-6, 1e-6)
    assert filling == pytest.approx(PAPER_CLUSTER_SIZES[1] * 4 / 3)
    assert paper_filling_of_level_area(load_trays()[8], 1e-6, 1e-6) is None
