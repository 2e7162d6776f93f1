"""Simulated films of growing clusters: cluster sizes and widths of the autocorrelation.

Every run has its own sticking speed, so that all sizes occur, and its own effects of camera, light
and dust, from none to 1.5 times those in flight: the scatter of the widths includes them.

Tested by ``test/studies/libraries/test_cluster_simulations.py``.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros import __version__
from nanorocks_ros.experiment.view import View
from nanorocks_ros.inference.cluster_size.cluster_curve import curve_key
from nanorocks_ros.records import Frame, Notice, TrayImage
from nanorocks_ros.settings import (
    PipelineSettings,
    SceneSettings,
    SimulationSettings,
    with_values,
)
from nanorocks_ros.stages.clusters.correlation_width import correlated
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Since the shaking event, [s]; the growth of clusters slows down.
TIMES = (0.4, 0.8, 1.2, 1.7, 2.3, 3.0, 4.0, 5.5, 7.5, 10.0, 14.0, 19.0, 25.0, 32.0)
# Range of the sticking speed, [m/s]: from hardly any cluster to a single one.
_SLOWEST, _FASTEST = 1e-4, 2e-2
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
# Effects whose strength is drawn.
EFFECTS = (
    'defocus_px',
    'noise',
    'vignetting',
    'gradient',
    'flicker',
    'shadows',
    'chalk',
    'glare',
    'ovality',
    'irregularity',
)
# Relative range of the number of beads.
_COUNT_SPREAD = 0.05
_QUALITY = 85
_FIRST_SHAKE = 0.1
_NS = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterPlan:
    """Parameters of the simulations for cluster curves.

    Parameters
    ----------
    cells : mapping of int to Tray
        All cells of the plate, by number.
    trays : tuple of int
        Trays with curves.
    runs : int
    seed : int
    level : float
        Level of the autocorrelation at which the width is measured.
    strengths : tuple of 2 floats, >= 0
        Range of the effects of camera, light and dust, relative to flight. A narrow range, for a
        camera that is known well, gives small errors.
    moments : int
        Number of `TIMES` that are filmed.
    """

    cells: Mapping[int, Tray]
    trays: tuple[int, ...]
    runs: int
    seed: int = 1
    level: float = 0.5
    strengths: tuple[float, float] = (0.0, 1.5)
    moments: int = len(TIMES)

    def specification(self) -> str:
        """Everything that the curves depend on, as a JSON object."""
        keys = {str(number): json.loads(curve_key(self.cells[number])) for number in self.trays}
        return json.dumps(
            {
                'version': __version__,
                'runs': self.runs,
                'seed': self.seed,
                'level': self.level,
                'strengths': self.strengths,
                'moments': self.moments,
                'trays': keys,
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterRun:
    """Random parameters of one run.

    Parameters
    ----------
    sticking_speed : float, [m/s]
    strengths : dict of str to float
        Of the effects, relative to flight.
    counts : dict of int to float
        Of the beads of each tray, relative to those listed.
    """

    sticking_speed: float
    strengths: dict[str, float]
    counts: dict[int, float]


def drawn_run(plan: ClusterPlan, run: int) -> ClusterRun:
    """Draw the parameters of a run; they depend only on the seed of the plan and the run."""
    generator = np.random.default_rng((plan.seed, run))
    # Multiples of the golden ratio fill the range evenly for any number of runs.
    part = (0.5 + run * _GOLDEN) % 1.0
    strengths = generator.uniform(*plan.strengths, len(EFFECTS))
    counts = generator.uniform(1.0 - _COUNT_SPREAD, 1.0 + _COUNT_SPREAD, len(plan.cells))
    return ClusterRun(
        sticking_speed=_SLOWEST * (_FASTEST / _SLOWEST) ** part,
        strengths=dict(zip(EFFECTS, strengths.tolist(), strict=True)),
        counts=dict(zip(sorted(plan.cells), counts.tolist(), strict=True)),
    )


def cluster_sizes(bodies: NDArray[np.int32]) -> tuple[float, float]:
    """Weight- and number-averaged number of beads per body.

    Parameters
    ----------
    bodies : ndarray of int, (n,)
        The body of each bead.
    """
    sizes = np.unique(bodies, return_counts=True)[1].astype(np.float64)
    return float((sizes**2).sum() / sizes.sum()), float(sizes.mean())


def samples_of_run(plan: ClusterPlan, run: int) -> NDArray[np.float32]:
    """Film a run, and measure the images of its trays as the pipeline does.

    Parameters
    ----------
    plan : ClusterPlan
    run : int, >= 0

    Returns
    -------
    ndarray of float32, (n_samples, 7)
        Tray, run, time since the shaking event [s], weight-averaged size, level area and inner
        area [m^2], contrast.

    Raises
    ------
    ConfigurationError
        For trays that cannot be filmed together.
    SimulationError
        When the beads do not fit, or a run has events without end.
    """
    return filmed_run(plan, run, drawn_run(plan, run), TIMES[: plan.moments])[:, :-1]


def filmed_run(
    plan: ClusterPlan, run: int, drawn: ClusterRun, times: Sequence[float]
) -> NDArray[np.float32]:
    """Film a run with given parameters at given times, and measure the images of its trays.

    Parameters
    ----------
    plan : ClusterPlan
    run : int, >= 0
        Number that seeds the gas.
    drawn : ClusterRun
    times : sequence of float, [s]
        Since the shaking event, rising.

    Returns
    -------
    ndarray of float32, (n_samples, 8)
        As `samples_of_run`, and the covered fraction of the image.
    """
    from nanorocks_ros.simulation.plate_scene.plate_film import SceneFilm

    simulation, scene, cells = _settings(plan, run, drawn)
    film = SceneFilm(simulation, scene, cells)
    names = {
        'trays': list(plan.trays),
        'preprocess.layout': 'plate',
        'preprocess.pixels_per_metre': scene.pixels_per_metre,
    }
    settings = with_values(PipelineSettings(), names, 'cluster films')
    view = View(camera=film.camera.geometry.camera)
    preprocessor = Preprocessor(settings, cells, 'cluster film', view)
    # Images may come some frames late.
    truths: dict[int, tuple[float, dict[int, float]]] = {}
    records: list[TrayImage | Notice] = []
    for time in times:
        number = round((_FIRST_SHAKE + time) * simulation.frame_rate)
        moment = film.at(number, round(_NS * number / simulation.frame_rate))
        sizes = {beads.tray: cluster_sizes(beads.bodies)[0] for beads in moment.beads}
        truths[moment.frame.stamp_ns] = time, sizes
        records += preprocessor.push(_compressed(moment.frame))
    rows = []
    for record in (*records, *preprocessor.flush()):
        if isinstance(record, TrayImage):
            time, sizes = truths[record.stamp_ns]
            correlation = correlated(record.gray, scene.pixels_per_metre)
            width = correlation.width(correlation.region(plan.level).area)
            rows.append((record.tray, run, time, sizes[record.tray], *width))
    return np.array(rows, dtype=np.float32).reshape(-1, 8)


def _compressed(frame: Frame) -> Frame:
    """The frame after JPEG."""
    jpeg = cv2.imencode('.jpg', frame.image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    image = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), dtype=np.uint8)
    return Frame(stamp_ns=frame.stamp_ns, encoding='bgr8', image=image)


def _settings(
    plan: ClusterPlan, run: int, drawn: ClusterRun
) -> tuple[SimulationSettings, SceneSettings, dict[int, Tray]]:
    flown = SceneSettings()
    strong = {name: getattr(flown, name) * by for name, by in drawn.strengths.items()}
    scene = with_values(flown, {'trays': plan.trays, **strong}, 'cluster films')
    values = {
        # A different gas for every run and every seed.
        'seed': int(np.random.SeedSequence((plan.seed, run)).generate_state(1)[0] >> 1),
        'sticking_speed': drawn.sticking_speed,
        # As in the packaged calibration: its points can be made again.
        'aggregate_motion': 'translating',
        'first_shake': _FIRST_SHAKE,
        'shake_period': 10.0 * TIMES[-1],
    }
    simulation = with_values(SimulationSettings(), values, 'cluster films')
    cells = {
        number: _with_count(tray, drawn.counts[number]) for number, tray in plan.cells.items()
    }
    return simulation, scene, cells


def _with_count(tray: Tray, factor: float) -> Tray:
    species = tuple(
        replace(beads, count=max(1, round(beads.count * factor))) for beads in tray.species
    )
    return replace(tray, species=species)
