"""How clusters are packed in a simulated tray, in pictures and in space: with the truth.

Tested by ``test/studies/analysis/test_cluster_packing.py``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import SimulationError
from nanorocks_ros.physics.filling_factor import (
    hull_area,
)
from nanorocks_ros.records import Frame, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.stages.clusters.correlation_width import correlated_with_shadows
from nanorocks_ros.stages.clusters.packing_density import packing_of_clusters
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.studies.analysis.cluster_packing import PackingCurve

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Notice
    from nanorocks_ros.settings import SimulationSettings


# The picture holds the tray and so much around it, [m].
_AROUND = 0.004


def simulated_packing(
    tray: Tray,
    settings: SimulationSettings,
    cycles: int,
    interval: float = 1.0,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[PackingCurve, ...]:
    """A tray that is shaken again and again, filmed in pictures that are taken now and then.

    Parameters
    ----------
    tray : Tray
    settings : SimulationSettings
        Of the gas; `first_shake` and the camera are set here.
    cycles : int, >= 1
    interval : float, [s]
        Between pictures.
    progress : callable, optional
        Called with the pictures done and all there are.

    Raises
    ------
    SimulationError
        When beads do not fit, or fewer than one cycle is asked for.
    """
    if cycles < 1:
        raise SimulationError('cycles', f'{cycles}', 'give 1 or more')
    scale = settings.pixels_per_metre
    length, width = tray.dimensions[:2]
    settings = replace(
        settings,
        tray=tray.number,
        first_shake=0.0,
        frame_rate=1.0 / interval,
        width_px=math.ceil(scale * (length + _AROUND)),
        height_px=math.ceil(scale * (width + _AROUND)),
    )
    gas = ShakenTray(settings, tray)
    camera = TrayCamera(settings, tray, gas.radii, gas.materials)
    pipeline = with_values(
        PipelineSettings(),
        {'trays': [tray.number], 'preprocess.pixels_per_metre': scale},
        'simulated packing',
    )
    stage = Preprocessor(pipeline, {tray.number: tray}, 'simulated tray')
    frames = round(cycles * settings.shake_period / interval)
    rows: list[tuple[float, ...]] = []
    # Level areas by stamp: images may come some frames late.
    areas: dict[int, float] = {}
    stamps = []
    for number, moment in enumerate(gas.moments(frames)):
        image = camera.picture(moment.positions, number)
        stamp_ns = moment.truth.stamp_ns
        frame = Frame(stamp_ns=stamp_ns, encoding='bgr8', image=image)
        areas |= _level_areas(stage.push(frame), scale, pipeline.clusters.level)
        stamps.append(stamp_ns)
        age = stamp_ns / 1e9 - (gas.origin or 0.0)
        rows.append((gas.cycle, age, math.nan, *_truth(tray, gas, moment.positions)))
        if progress is not None:
            progress(number + 1, frames)
    areas |= _level_areas(stage.flush(), scale, pipeline.clusters.level)
    table = np.array(rows)
    table[:, 2] = [areas.get(stamp_ns, math.nan) for stamp_ns in stamps]
    return _curves(tray.number, table)


def _level_areas(
    records: Iterable[TrayImage | Notice], scale: float, level: float
) -> dict[int, float]:
    """Level area of the autocorrelation of each tray image by its stamp, [m^2]."""
    areas = {}
    for record in records:
        if isinstance(record, TrayImage):
            # As the paper looks at pictures.
            seen = correlated_with_shadows(record.gray, scale)
            areas[record.stamp_ns] = seen.region(level).area * seen.side**2
    return areas


def _truth(
    tray: Tray, gas: ShakenTray, positions: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Beads in a cluster, and filling factors: of a layer, by the paper, in space."""
    bodies, radii = gas.bodies, gas.radii
    packing = packing_of_clusters(positions[:, :2], radii, bodies, tray.dimensions[2])
    if packing is None:
        return math.nan, math.nan, math.nan, math.nan
    volume = room = 0.0
    for label in np.unique(bodies):
        own = np.flatnonzero(bodies == label)
        if own.size > 1:
            z, r = positions[own, 2], radii[own]
            volume += 4.0 / 3.0 * math.pi * float(np.sum(r**3))
            room += hull_area(positions[own, :2], r) * float((z + r).max() - (z - r).min())
    return packing.beads, packing.filling, packing.paper, volume / room


def _curves(tray: int, rows: NDArray[np.float64]) -> tuple[PackingCurve, ...]:
    curves = []
    for cycle in np.unique(rows[:, 0]):
        own = rows[rows[:, 0] == cycle]
        curves.append(
            PackingCurve(
                tray=tray,
                cycle=int(cycle),
                times=own[:, 1],
                level_area=own[:, 2],
                beads=own[:, 3],
                filling=own[:, 4],
                paper=own[:, 5],
                in_space=own[:, 6],
            )
        )
    return tuple(curves)
