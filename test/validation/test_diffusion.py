"""Self-diffusion in a dense gas, against published values."""

from functools import cache

import pytest

from benchmarks import hard_spheres
from benchmarks.hard_sphere_runs import LAGS, diffusion, over_runs

DENSITY = 0.5
CELLS = 5
BEADS = 4 * CELLS**3


@cache
def measured():
    return over_runs(lambda seed: diffusion(CELLS, DENSITY, seed), range(8))


def test_self_diffusion_of_500_beads_is_the_published_one():
    # Published: Speedy 1987, doi:10.1080/00268978700102371, a fit to runs of some 500 beads in
    # a periodic cube. Its polynomial is quoted from memory and could not be looked up, so the
    # tolerance of 3 % covers both the spread of the published runs (1 to 2 %) and four errors
    # of these (0.6 % each); without the polynomial it would be off by 5 %.
    result = measured()
    assert result.error / result.mean < 0.01
    assert result.mean == pytest.approx(hard_spheres.speedy_diffusion(DENSITY), rel=0.03)


def test_self_diffusion_exceeds_enskogs_as_published():
    # Published: D/D_E = 1.331 for infinitely many beads, Erpenbeck, Wood 1991,
    # doi:10.1103/PhysRevA.43.4254. The fit is quoted from memory and could not be looked up.
    # 500 beads lack 9 %, which goes as 1/side and is added after theory (Yeh, Hummer 2004,
    # doi:10.1021/jp0477147; `benchmarks engine_physics` shows that 500, 1372 and 4000 beads then
    # agree). Tolerance: 4 %, that is 1 % for the fit, 0.5 % for what is added and four errors of
    # these runs. Enskog alone would be off by 25 %.
    result = measured()
    corrected = result.mean + hard_spheres.missing_diffusion(DENSITY, result.mean, BEADS, LAGS)
    ratio = corrected / hard_spheres.enskog_diffusion(DENSITY)
    assert ratio == pytest.approx(hard_spheres.erpenbeck_wood_ratio(DENSITY), rel=0.04)
