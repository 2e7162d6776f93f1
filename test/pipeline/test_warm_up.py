"""What was compiled beforehand is all that the first cycle needs."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from sticking_records import cooling

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.inference.decay.likelihood_kernels import evaluate
from nanorocks_ros.inference.likelihood_1d import _smeared
from nanorocks_ros.numerics.small_cholesky import integrate
from nanorocks_ros.numerics.splines import spline_at, spline_basis, spline_slopes
from nanorocks_ros.physics.sticking_rates import _sum_slower
from nanorocks_ros.pipeline.warm_up import warm_up_clusters, warm_up_cooling
from nanorocks_ros.records import Measured, Rebound, SpeedEstimate
from nanorocks_ros.settings import PipelineSettings
from nanorocks_ros.stages.clusters.sticking_estimator import StickingEstimator
from nanorocks_ros.stages.restitution.restitution_estimator import RestitutionEstimator

NS = 1_000_000_000

# What Python calls. What only other kernels call is compiled into them, and not once more when
# those come from the cache on the disk.
KERNELS = (evaluate, integrate, spline_at, spline_basis, spline_slopes, _smeared, _sum_slower)


def compiled_for():
    """For which types of arguments each kernel of the estimates is compiled."""
    return [tuple(kernel.signatures) for kernel in KERNELS]


def rebound(time):
    return Rebound(
        stamp_ns=round(time * NS),
        tray=1,
        track=0,
        species=0,
        wall=0,
        incoming=Measured(2e-3, 1e-4),
        outgoing=Measured(1.9e-3, 1e-4),
        tangential_incoming=0.0,
        tangential_outgoing=0.0,
        tangential_error=1e-4,
        wall_velocity=Measured(0.0, 0.0),
        place=np.zeros(2),
    )


def test_the_estimates_of_a_first_cycle_compile_nothing_more():
    warm_up_cooling()
    warm_up_clusters()
    before = compiled_for()
    assert all(before)
    tray = load_trays()[1]
    fitter, meter = (
        kind(PipelineSettings(), tray) for kind in (RestitutionEstimator, StickingEstimator)
    )
    for time in (3.0, 4.0, 5.0):
        fitter.push(rebound(time))
    results = []
    for record in cooling(until=24.0):
        meter.push(record)
        if isinstance(record, SpeedEstimate):
            results += fitter.push(record)
    assert results[-1].rebounds == 3
    assert results[-1].restitution.value == pytest.approx(0.9, abs=0.2)
    assert meter.of_cycle(1, 20 * NS) is not None
    assert compiled_for() == before


# In a process of its own: what other tests compiled would count as compiled beforehand.
FIRST_CYCLE = """
import gc
from numba.core.registry import CPUDispatcher
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.pipeline import warm_up
from nanorocks_ros.pipeline.composition import TrayStages, trays_of
from nanorocks_ros.settings import PipelineSettings, SimulationSettings, with_values
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

def compiled():
    kernels = [kept for kept in gc.get_objects() if isinstance(kept, CPUDispatcher)]
    return {(kernel.py_func.__name__, str(key)) for kernel in kernels for key in kernel.overloads}

settings = with_values(PipelineSettings(), {'preprocess.pixels_per_metre': 13500.0}, 'test')
camera = SimulationSettings(
    width_px=240, height_px=240, pixels_per_metre=13500.0, restitution=0.8, seed=3
)
frames = [frame for frame, _ in film(camera, load_trays()[1], 420)]
preprocessor = Preprocessor(settings, trays_of(settings), 'test')
stages = TrayStages.of(settings, load_trays()[1])
for prepare in (
    warm_up.warm_up,
    warm_up.warm_up_speed,
    warm_up.warm_up_clusters,
    warm_up.warm_up_cooling,
):
    prepare()
before = compiled()
results = []
for frame in frames:
    for record in preprocessor.push(frame):
        results += stages.push(record)
results += stages.flush()
print([type(record).__name__ for record in results].count('CorEstimate'))
print(sorted(compiled() - before))
"""


def test_a_first_cycle_of_a_film_compiles_nothing_more():
    command = [sys.executable, '-c', FIRST_CYCLE]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    estimates, later = done.stdout.splitlines()
    assert int(estimates) > 5
    assert later == '[]'
