"""How far the points of a sweep are from a decay, and the map of it."""

from __future__ import annotations

import cv2
import matplotlib as mpl
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.jobs.tasks import Workers
from nanorocks_ros.outputs.figure_style import MAP
from nanorocks_ros.outputs.tables.csv_tables import write_csv
from nanorocks_ros.outputs.tables.table_columns import float_columns
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.studies.decays.chi_square_map import chi_square
from nanorocks_ros.studies.decays.decay_curve import SpeedCurve, curve_at, read_curve
from nanorocks_ros.studies.figures.sweep_figure import chi_square_figure
from nanorocks_ros.studies.sweeps.sweep_plan import sweep_plan
from nanorocks_ros.studies.sweeps.sweep_runs import sweep

HERE = Workers(processes=1)
TIMES = np.linspace(0.0, 10.0, 11)
AXES = {'restitution': (0.6, 0.75, 0.9), 'wall_restitution': (0.85, 0.92, 0.99)}
FIELDS = ('time', 'mean_projected_speed', 'mean_projected_speed_error')


@pytest.fixture(scope='module')
def grid():
    return sweep(sweep_plan(SimulationSettings(), AXES, TIMES, 40), workers=HERE)


@pytest.fixture(scope='module')
def point():
    """A single point of the grid, other runs."""
    settings = SimulationSettings(seed=5, restitution=0.75, wall_restitution=0.92)
    return sweep_plan(settings, {}, TIMES, 40)


def table(path, columns, fields=FIELDS):
    write_csv(
        path, float_columns(fields, ['s', 'm/s', 'm/s'][: len(fields)]), zip(*columns, strict=True)
    )
    return path


def test_a_point_agrees_with_itself(grid):
    chi_squares = chi_square(grid, curve_at(grid, (0.75, 0.92)))
    assert chi_squares[1, 1] == 0.0
    assert chi_squares.shape == (3, 3)
    assert (np.delete(chi_squares.ravel(), 4) > 0.0).all()


def test_the_true_point_is_found_among_others(grid, point, tmp_path):
    sweep(point, tmp_path / 'point.npz', HERE)
    chi_squares = chi_square(grid, read_curve(tmp_path / 'point.npz'))
    # Of the order of 1 where both are the same gas; hundreds far away.
    assert chi_squares[1, 1] < 3.0
    assert chi_squares[0, 0] > 30.0
    assert chi_squares[2, 2] > 30.0


def test_chi_square_is_the_mean_squared_deviation_over_both_errors(grid):
    curve = SpeedCurve(times=TIMES, speed=np.full(11, 0.002), error=np.full(11, 1e-4))
    mean, sweep_error = grid.mean_projected_speed[2, 0], grid.mean_projected_speed_error[2, 0]
    expected = np.mean((mean - 0.002) ** 2 / (sweep_error**2 + 1e-8))
    assert chi_square(grid, curve)[2, 0] == pytest.approx(expected, rel=1e-12)


def test_only_times_that_the_curve_covers_are_compared(grid):
    times = np.array([1.5, 8.0])
    curve = SpeedCurve(times=times, speed=np.full(2, 0.002), error=np.zeros(2))
    part = (slice(None), slice(None), slice(2, 9))
    mean, sweep_error = grid.mean_projected_speed[part], grid.mean_projected_speed_error[part]
    expected = np.mean((mean - 0.002) ** 2 / sweep_error**2, axis=-1)
    np.testing.assert_allclose(chi_square(grid, curve), expected, rtol=1e-12)


def test_a_table_gives_the_same_as_the_point(grid, tmp_path):
    curve = curve_at(grid, (0.9, 0.85))
    read = read_curve(table(tmp_path / 'a.csv', (curve.times, curve.speed, curve.error)))
    np.testing.assert_array_equal(chi_square(grid, read), chi_square(grid, curve))


def test_an_error_that_is_not_known_counts_as_none(grid, tmp_path):
    curve = curve_at(grid, (0.9, 0.85))
    read = read_curve(table(tmp_path / 'a.csv', (curve.times, curve.speed), FIELDS[:2]))
    assert not read.error.any()
    unknown = np.full(11, np.nan)
    read = read_curve(table(tmp_path / 'b.csv', (curve.times, curve.speed, unknown)))
    assert not read.error.any()


def test_speeds_that_are_not_known_are_left_out(tmp_path):
    speeds = [3.0, np.nan, 1.0]
    read = read_curve(table(tmp_path / 'a.csv', ([0.0, 1.0, 2.0], speeds, [0.1] * 3)))
    assert read.times.tolist() == [0.0, 2.0]


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ('', 'no table of numbers; give the columns time'),
        ('time [s],speed [m/s]\n0,1\n', 'holds no curve; give the columns time'),
        ('time,mean_projected_speed\n0,x\n', 'no table of numbers'),
        ('time,mean_projected_speed\n0\n', 'no table of numbers'),
        ('time,mean_projected_speed\n0,1\n', 'its times do not rise'),
        ('time,mean_projected_speed\n0,1\n2,1\n1,1\n', 'its times do not rise'),
        ('time,mean_projected_speed\n\xff,1\n', 'no table of numbers'),
    ],
)
def test_tables_that_are_no_curve_are_refused(tmp_path, content, message):
    path = tmp_path / 'a.csv'
    path.write_bytes(content.encode('latin-1'))
    with pytest.raises(RecordingError, match=message):
        read_curve(path)


def test_a_grid_is_no_curve(grid, tmp_path):
    grid.save(tmp_path / 'grid.npz')
    with pytest.raises(RecordingError, match=r'shape \(3, 3, 11\); name a file of one curve'):
        read_curve(tmp_path / 'grid.npz')


def test_a_point_off_the_grid_is_refused(grid):
    with pytest.raises(ConfigurationError, match=r'restitution 0.7; choose one of 0.6, 0.75, 0.9'):
        curve_at(grid, (0.7, 0.92))
    with pytest.raises(ConfigurationError, match=r'1 values for 2 axes'):
        curve_at(grid, (0.75,))


def test_curves_that_cannot_be_compared_are_refused(grid):
    late = SpeedCurve(times=np.array([50.0, 60.0]), speed=np.ones(2), error=np.ones(2))
    with pytest.raises(ConfigurationError, match='covers 0 of the times of the sweep'):
        chi_square(grid, late)
    single = sweep(sweep_plan(SimulationSettings(), {}, TIMES, 1), workers=HERE)
    with pytest.raises(ConfigurationError, match='no errors are known; sweep with two or more'):
        chi_square(single, curve_at(single, ()))


def test_the_map_is_dark_where_curves_agree_and_bright_where_they_do_not(grid, tmp_path):
    path = tmp_path / 'map.png'
    chi_square_figure(path, grid, curve_at(grid, (0.75, 0.92)))
    picture = cv2.imread(str(path))
    assert min(picture.shape[:2]) > 500
    # The ends of the scale: the reference itself, and the point that is farthest away.
    pixels = picture.reshape(-1, 3)[::7].astype(int)
    for end in (0.0, 1.0):
        colour = 255.0 * np.array(mpl.colormaps[MAP](end)[2::-1])
        assert np.abs(pixels - colour).max(axis=1).min() <= 1.5


def test_a_sweep_that_is_no_map_is_not_drawn(tmp_path):
    result = sweep(sweep_plan(SimulationSettings(), {}, TIMES, 2), workers=HERE)
    with pytest.raises(ConfigurationError, match='a single point; vary two numbers'):
        chi_square_figure(tmp_path / 'map.png', result, curve_at(result, ()))
