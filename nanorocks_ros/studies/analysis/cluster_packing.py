"""How clusters are packed over a cycle: from results of an analysis, or simulated with the truth.

The paper sees the level area of the autocorrelation fall after its maximum and concludes that
clusters become more compact. Simulated clusters are rigid: what falls there is no compaction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError, SimulationError
from nanorocks_ros.physics.filling_factor import (
    PAPER_CLUSTER_SIZES,
    hull_area,
    paper_cluster_filling,
)
from nanorocks_ros.records import Frame, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.simulation.shaken_tray import ShakenTray
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.stages.clusters.correlation_width import correlated_with_shadows
from nanorocks_ros.stages.clusters.packing_density import packing_of_clusters
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.studies.analysis.results.result_tables import read_columns

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import Notice
    from nanorocks_ros.settings import SimulationSettings

# Level areas are taken together over this time, [s]; of a cycle the last part is its end.
_TOGETHER = 2.0
_END = 0.15
# By then clusters have formed in the paper (its figure 8e), [s].
_SETTLED = 6.0, 14.0
# The picture holds the tray and so much around it, [m].
_AROUND = 0.004
_FEWEST = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class PackingCurve:
    """One cycle of one tray.

    Parameters
    ----------
    tray, cycle : int
    times : ndarray (n,), [s]
        Since the shaking event.
    level_area : ndarray (n,), [m^2]
        Of the autocorrelation of the picture.
    beads : ndarray (n,)
        True mean number in a cluster; NaN where not known, or where there is no cluster. So are
        the following.
    filling, paper : ndarray (n,)
        From true places and bodies: of a layer, and by the paper's formula.
    in_space : ndarray (n,)
        With the true height of each cluster, from its lowest bead to its highest.
    """

    tray: int
    cycle: int
    times: NDArray[np.float64]
    level_area: NDArray[np.float64]
    beads: NDArray[np.float64]
    filling: NDArray[np.float64]
    paper: NDArray[np.float64]
    in_space: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Compaction:
    """Compaction of the clusters of one cycle between the widest autocorrelation and the end.

    Parameters
    ----------
    widest, end : float, [m^2]
        Level areas.
    apparent : float
        (ff_end - ff_min) / ff_min as the paper has it, which is widest / end - 1: the number of
        beads, the calibration and the height cancel. The widest of values that scatter is wide by
        chance, so that this is above 0 for clusters that don't change.
    settled : float
        The same from a time that is fixed, 6 to 14 s after the shaking event, to the end.
    true : float
        As `apparent`, of the filling factor from true places; NaN where not known.
    """

    widest: float
    end: float
    apparent: float
    settled: float
    true: float


def compaction(curve: PackingCurve) -> Compaction:
    """The compaction of a cycle, by the paper's rule and in truth.

    Raises
    ------
    RecordingError
        When the cycle is too short, or has no autocorrelation.
    """
    step = max(1, round(_TOGETHER / float(np.median(np.diff(curve.times)))))
    count = curve.times.size // step
    if count < _FEWEST:
        raise RecordingError(
            f'tray {curve.tray}, cycle {curve.cycle}',
            f'{count * _TOGETHER:g} s of autocorrelations',
            f'analyse a recording of {_FEWEST * _TOGETHER:g} s and more after a shaking event',
        )
    areas = np.median(curve.level_area[: count * step].reshape(count, step), axis=1)
    last = max(1, round(_END * count))
    widest, end = int(np.argmax(areas[: count - last])), float(np.mean(areas[-last:]))
    if not end > 0.0:
        raise RecordingError(
            f'tray {curve.tray}, cycle {curve.cycle}',
            'its picture is uniform',
            'check the tray map with `nanorocks look`',
        )
    then = curve.filling[widest * step : (widest + 1) * step]
    now = curve.filling[-last * step :]
    middle = (curve.times >= _SETTLED[0]) & (curve.times <= _SETTLED[1])
    has_values = np.isfinite(then).any() and np.isfinite(now).any()
    return Compaction(
        widest=float(areas[widest]),
        end=end,
        apparent=max(float(areas[widest]), end) / end - 1.0,
        settled=float(np.mean(curve.level_area[middle])) / end - 1.0 if middle.any() else math.nan,
        true=float(np.nanmean(now) / np.nanmean(then)) - 1.0 if has_values else math.nan,
    )


def paper_filling_of_level_area(
    tray: Tray, level_area: float, single_level_area: float
) -> float | None:
    """Filling factor by the paper's formula from the picture, with its count of beads by hand.

    The paper does not print how a level area becomes the area of a cluster. Here that of single
    beads, as it is just after a shaking event, stands for the area of one bead.

    Parameters
    ----------
    tray : Tray
    level_area, single_level_area : float, [m^2]

    Returns
    -------
    float or None
        None for a tray whose beads the paper did not count one by one.
    """
    beads = PAPER_CLUSTER_SIZES.get(tray.number)
    if beads is None:
        return None
    radius = 0.5 * tray.diameter
    squares = sum(species.count * species.diameter**2 for species in tray.species) / tray.count
    volume = sum(species.count * species.diameter**3 for species in tray.species) / tray.count
    area = level_area / single_level_area * 0.25 * math.pi * squares
    return paper_cluster_filling(beads, math.pi / 6.0 * volume, area, radius)


def measured_packing(folder: Path, tray: int) -> tuple[PackingCurve, ...]:
    """Level areas by cycle, from results of `nanorocks analyse`.

    Raises
    ------
    RecordingError
        When the tables cannot be read, or hold no cycle.
    """
    table = read_columns(folder / f'tray_{tray}_cluster.csv', ('time', 'cycle', 'level_area'))
    speeds = read_columns(folder / f'tray_{tray}_speed.csv', ('cycle', 'cycle_start'))
    has_start = np.isfinite(speeds['cycle_start'])
    starts = dict(zip(speeds['cycle'][has_start], speeds['cycle_start'][has_start], strict=True))
    curves = []
    for cycle, start in starts.items():
        own = (table['cycle'] == cycle) & (table['time'] >= start)
        # A recording that was played twice holds its cycles twice: the first time is enough.
        times = table['time'][own] - start
        rising = np.concatenate(([True], np.diff(times) > 0.0))[: times.size]
        first = times.size if rising.all() else int(np.argmin(rising))
        if first > 1:
            nothing = np.full(first, math.nan)
            curves.append(
                PackingCurve(
                    tray=tray,
                    cycle=int(cycle),
                    times=times[:first],
                    level_area=table['level_area'][own][:first],
                    beads=nothing,
                    filling=nothing,
                    paper=nothing,
                    in_space=nothing,
                )
            )
    if not curves:
        raise RecordingError(
            str(folder),
            f'holds no autocorrelation of tray {tray} after a shaking event',
            'analyse a recording with a shaking event',
        )
    return tuple(curves)


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
