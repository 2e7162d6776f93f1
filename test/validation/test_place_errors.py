"""Stated errors of places and radii against true ones: a drawn film and one by other code."""

from __future__ import annotations

from functools import cache

import numpy as np
from shared_films import foreign_film

from benchmarks.film_measurement import measure
from benchmarks.film_truth import read_truth
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings, with_values
from nanorocks_ros.studies.synthetic.drawn_film import write_drawn_film

# Within which stated errors count as right.
FACTOR = 1.5


@cache
def errors_of(video):
    result = measure(read_truth(video))
    assert result.refusal == ''
    return result.errors


def place_ratios(video):
    return [errors.place_ratio for errors in errors_of(video)]


def within(ratios, factor):
    return bool(np.all(np.abs(np.log(ratios)) <= np.log(factor)))


# Errors from a constant of the simulated camera were 1.8 to 2.2 times too large here.
def test_errors_are_as_stated_in_a_film_by_other_code():
    assert within(place_ratios(foreign_film('p3a')), FACTOR)


# Stated from the scatter alone they were 2.8 times too small: blur moves all outlines alike.
def test_errors_of_the_radii_of_small_beads_hold_the_bias_by_blur():
    _, glass = errors_of(foreign_film('p3a'))
    assert within([glass.radius_ratio], 2.0)


def test_errors_are_as_stated_in_a_film_of_a_drawn_camera(tmp_path):
    values = {'tray': 1, 'seed': 11, 'mean_speed': 0.008, 'first_shake': 1.0}
    simulation = with_values(SimulationSettings(), values, 'test')
    stem = tmp_path / 'drawn'
    write_drawn_film(stem, load_trays()[1], simulation, 4.0, 34, moving=0.0)
    (video,) = [path for path in tmp_path.glob('drawn.*') if path.suffix in ('.mp4', '.avi')]
    assert within(place_ratios(video), FACTOR)
