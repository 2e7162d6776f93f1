"""Equipartition in an elastic gas.

Published: the theorem of equipartition, with the corrections for a momentum of zero (Maxwell
1879; Shirts, Burt, Johnson 2006, J. Chem. Phys. 125, 164102, doi:10.1063/1.2359432). Tolerance:
four errors of independent runs, which must be below 0.5 %.
"""

import pytest

from benchmarks.hard_sphere_runs import (
    mixture_temperature_ratio,
    over_runs,
    rough_temperature_ratio,
)

RUNS = range(12)


def test_light_and_heavy_beads_come_to_one_temperature():
    ratio = over_runs(mixture_temperature_ratio, RUNS)
    assert ratio.error < 0.005
    assert ratio.mean == pytest.approx(1.0, abs=4.0 * ratio.error)


def test_rotation_and_translation_of_rough_spheres_come_to_one_temperature():
    ratio = over_runs(rough_temperature_ratio, RUNS)
    assert ratio.error < 0.005
    assert ratio.mean == pytest.approx(1.0, abs=4.0 * ratio.error)
