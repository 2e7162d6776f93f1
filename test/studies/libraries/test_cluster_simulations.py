"""Making calibrations of cluster sizes: the same again, resumed, refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.cli.main import main
from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.cluster_size.cluster_curve import curve_of
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.studies.libraries.cluster_films import (
    EFFECTS,
    ClusterPlan,
    cluster_sizes,
    drawn_run,
    samples_of_run,
)
from nanorocks_ros.studies.libraries.cluster_simulations import build_curves

TRAYS = load_trays()
HERE = Workers(processes=1)
# One moment of each film: of no use but to see how a calibration is made.
PLAN = ClusterPlan(cells=TRAYS, trays=(1,), runs=8, moments=1)


class Enough(KeyboardInterrupt):
    """Ctrl-C at a certain moment."""


def test_a_point_of_the_packaged_calibration_is_what_its_film_shows_again():
    curve = curve_of(TRAYS[1])
    made_by = json.loads(curve.made_by)
    plan = ClusterPlan(
        cells=TRAYS,
        trays=tuple(int(number) for number in made_by['trays']),
        runs=made_by['runs'],
        seed=made_by['seed'],
        level=made_by['level'],
        strengths=tuple(made_by['strengths']),
        moments=2,
    )
    repeated = samples_of_run(plan, 5)
    for number in plan.trays:
        kept = curve_of(TRAYS[number]).samples
        kept = kept[kept[:, 0] == 5.0][:2]
        # Codecs and lenses may round otherwise elsewhere; beads may not.
        np.testing.assert_allclose(repeated[repeated[:, 0] == number, 1:4], kept[:, :3], rtol=1e-6)
        np.testing.assert_allclose(repeated[repeated[:, 0] == number, 4:], kept[:, 3:], rtol=0.02)


def test_weight_and_number_averages_of_known_bodies():
    # Bodies of 3, 1 and 2.
    assert cluster_sizes(np.array([0, 0, 0, 3, 4, 4])) == pytest.approx((14.0 / 6.0, 2.0))
    assert cluster_sizes(np.arange(9)) == (1.0, 1.0)
    assert cluster_sizes(np.zeros(9, dtype=np.int32)) == (9.0, 9.0)


def test_runs_differ_and_cover_the_sticking_speeds_and_strengths():
    drawn = [drawn_run(PLAN, run) for run in range(200)]
    speeds = np.sort([run.sticking_speed for run in drawn])
    assert np.diff(np.log(speeds)).max() < 0.1
    for name in EFFECTS:
        strengths = [run.strengths[name] for run in drawn]
        assert min(strengths) < 0.1 < 1.4 < max(strengths) < 1.5
    assert drawn_run(PLAN, 3) == drawn[3]
    assert drawn_run(replace(PLAN, seed=2), 3) != drawn[3]


def test_an_interrupted_calibration_goes_on_to_the_end(tmp_path):
    path = tmp_path / 'mine.npz'

    def stop(done, total):
        if done == 3:
            raise Enough

    with pytest.raises(KeyboardInterrupt, match=r'3 of \d+ parts are kept in .*mine.npz.parts'):
        build_curves(PLAN, path, HERE, stop)
    assert not path.exists()
    resumed = []
    build_curves(PLAN, path, HERE, lambda done, total: resumed.append((done, total)))
    assert resumed[0] == (3, 8)
    made = curve_of(TRAYS[1], path).samples
    assert made[:, 0].tolist() == list(range(8))
    # Of a run before the interruption, and of one after it.
    for run in (1, 6):
        np.testing.assert_array_equal(made[[run]], samples_of_run(PLAN, run)[:, 1:])
    assert not path.with_name('mine.npz.parts').exists()


def test_too_few_runs_are_refused_before_any_work(tmp_path):
    with pytest.raises(ConfigurationError, match='give 8 or more'):
        build_curves(replace(PLAN, runs=7), tmp_path / 'mine.npz', HERE)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ('flags', 'text'),
    [
        (['--tray', '9'], 'tray 9: does not exist'),
        (['--tray', '1', '--level', '2'], 'clusters.level'),
        (['--tray', '1', '--seed', '-1'], 'give 0 or more'),
        (['--tray', '1', '--runs', '2'], 'give 8 or more'),
    ],
)
def test_a_wrong_call_is_one_line(flags, text, tmp_path, capsys):
    assert main(['cluster-curve', *flags, '-o', str(tmp_path / 'c.npz')]) == 2
    stderr = capsys.readouterr().err
    assert text in stderr
    assert stderr.count('\n') == 1
