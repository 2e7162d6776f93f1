"""Cluster sizes from widths, within the range of the calibration."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.cluster_size.cluster_curve import as_arrays, curve_of
from nanorocks_ros.inference.cluster_size.curve_fit import fit_curve
from nanorocks_ros.inference.cluster_size.size_from_width import Width
from nanorocks_ros.outputs.npz_archive import write_archive
from nanorocks_ros.records import Measured, SizeStatus

AREA = 1e-6


def made_up(slope, scatter, count=4000, largest=20.0):
    """Pictures whose breadth grows as a power of the size, up to a size, about 2.5."""
    generator = np.random.default_rng(1)
    sizes = np.exp(generator.uniform(0.0, math.log(100.0), count))
    sizes[: count // 10] = 1.0
    breadth = 2.5 * np.minimum(sizes, largest) ** slope
    breadth *= np.exp(scatter * generator.normal(size=count))
    rows = np.zeros((count, 6), dtype=np.float32)
    rows[:, 2], rows[:, 3], rows[:, 4], rows[:, 5] = sizes, AREA * breadth, AREA, 40.0
    return rows


def seen(breadth, contrast=40.0):
    return Width(AREA * breadth, AREA, contrast)


CURVE = fit_curve('a tray', 0.5, made_up(0.2, 0.03))


@pytest.mark.parametrize('size', [1.5, 3.0, 8.0, 15.0])
def test_sizes_within_the_range_are_those_simulated_with_their_error(size):
    estimate = CURVE.size_of(seen(2.5 * size**0.2))
    assert estimate.status is SizeStatus.MEASURED
    assert estimate.size == pytest.approx(size, rel=0.07)
    assert estimate.lower < estimate.size < estimate.upper
    # A scatter of 0.03 over a slope of 0.2.
    if size > 3.0:
        assert estimate.error / estimate.size == pytest.approx(0.15, rel=0.35)


def test_the_curve_rises():
    assert (np.diff(CURVE.log_size) > 0.0).all()
    assert (np.diff(CURVE.reading[: CURVE.end]) > 0.0).all()
    assert (np.diff(CURVE.reading) >= 0.0).all()
    assert CURVE.log_size[0] == 0.0


def test_where_the_breadth_no_longer_grows_the_range_ends():
    assert 12.0 < CURVE.largest < 65.0
    estimate = CURVE.size_of(
        seen(1.03 * math.exp(0.5 * (CURVE.reading[CURVE.end - 1] - math.log(AREA))))
    )
    assert estimate.status is SizeStatus.BEYOND
    assert math.isnan(estimate.size)
    assert estimate.lower <= CURVE.largest
    assert estimate.upper == pytest.approx(100.0, rel=0.03)


def test_a_reading_on_the_flat_part_has_an_interval_up_to_the_largest_size():
    estimate = CURVE.size_of(seen(2.5 * 20.0**0.2 * math.exp(-0.02)))
    assert estimate.status is SizeStatus.MEASURED
    assert estimate.upper == pytest.approx(100.0, rel=0.03)


@pytest.mark.parametrize(
    ('size', 'excluded'),
    [
        (Measured(3.0, 0.0), False),
        (Measured(2.3, 0.0), False),
        (Measured(1.5, 0.0), True),
        (Measured(1.5, 0.5), False),
        (Measured(9.0, 0.0), True),
        (Measured(), False),
    ],
)
def test_a_size_is_excluded_beyond_two_standard_deviations(size, excluded):
    # 0.06 over a slope of 0.2 is a factor of 1.35.
    reading = CURVE.reading_of(2.5 * 3.0**0.2 * AREA, 2.5 * 3.0**0.2)
    assert CURVE.excludes(reading, size) is excluded


def test_single_beads_have_size_one_below_the_curve():
    estimate = CURVE.size_of(seen(2.5 * math.exp(-0.05)))
    assert (estimate.status, estimate.size, estimate.lower) == (SizeStatus.MEASURED, 1.0, 1.0)


@pytest.mark.parametrize(
    'width',
    [
        seen(0.5 * 2.5),
        seen(30.0),
        seen(3.0, contrast=5.0),
        Width(0.0, 0.0, 40.0),
        Width(0.1 * AREA, 0.04 * AREA, 40.0),
        Width(math.nan, math.nan, 40.0),
    ],
)
def test_widths_outside_the_simulated_range_have_no_size(width):
    estimate = CURVE.size_of(width)
    assert estimate.status is SizeStatus.NOTHING
    assert math.isnan(estimate.size)


def test_an_image_with_missing_beads_has_no_size():
    curve = fit_curve('a tray', 0.5, made_up(0.2, 0.03), discs=0.25)
    full, partial = (seen(3.0)._replace(cover=cover) for cover in (0.22, 0.15))
    assert curve.size_of(full).status is SizeStatus.MEASURED
    assert curve.size_of(partial).status is SizeStatus.NOTHING
    # Of a picture whose cover nobody measured nothing is known.
    assert curve.size_of(seen(3.0)).status is SizeStatus.MEASURED


def test_the_disc_area_of_the_flight_trays_follows_from_their_beads():
    # 15 beads of 2 mm on 15 mm x 15 mm.
    assert curve_of(load_trays()[1]).discs == pytest.approx(15 * math.pi / 225.0)


def test_a_tray_whose_breadth_does_not_depend_on_the_size_is_insensitive():
    curve = fit_curve('a tray', 0.5, made_up(0.01, 0.05))
    assert math.isnan(curve.largest)
    assert curve.size_of(seen(3.0)).status is SizeStatus.INSENSITIVE


def test_without_single_beads_there_is_no_curve():
    rows = made_up(0.2, 0.03)
    curve = fit_curve('a tray', 0.5, rows[rows[:, 2] > 2.0])
    assert curve.size_of(seen(3.0)).status is SizeStatus.INSENSITIVE


def test_all_flight_trays_have_a_curve_which_is_used_where_beads_are_resolved():
    curves = {number: curve_of(tray) for number, tray in load_trays().items()}
    assert sorted(curves) == list(range(1, 9))
    for number in (1, 3, 5, 7):
        assert curves[number].largest > 5.0
    # Chalk and glare, and grains that cover the floor.
    for number in (2, 4, 6, 8):
        assert math.isnan(curves[number].largest)


def with_fewer_beads():
    tray = load_trays()[3]
    return replace(tray, species=(replace(tray.species[0], count=7), tray.species[1]))


def test_another_tray_has_no_curve_and_the_error_names_the_command():
    tray = with_fewer_beads()
    with pytest.raises(
        ConfigurationError, match=r'nanorocks cluster-curve --trays 3 -o curve\.npz'
    ):
        curve_of(tray)


def test_a_file_serves_the_trays_it_was_made_for(tmp_path):
    path = tmp_path / 'mine.npz'
    tray = with_fewer_beads()
    rows = np.column_stack((np.full(4000, 3.0), made_up(0.2, 0.03)))
    write_archive(path, as_arrays({3: tray}, 0.5, rows, '{}'))
    assert curve_of(tray, path).size_of(seen(2.5 * 4.0**0.2)).size == pytest.approx(4.0, rel=0.07)
    with pytest.raises(ConfigurationError, match='no calibration of cluster sizes'):
        curve_of(load_trays()[3], path)


@pytest.mark.parametrize('content', [b'', b'no archive', b'PK\x03\x04 cut short'])
def test_a_damaged_file_is_an_error_of_one_line(tmp_path, content):
    path = tmp_path / f'{len(content)}.npz'
    path.write_bytes(content)
    with pytest.raises(ConfigurationError, match='is damaged, or no calibration') as caught:
        curve_of(load_trays()[1], path)
    assert '\n' not in str(caught.value)
