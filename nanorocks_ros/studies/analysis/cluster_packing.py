"""How clusters are packed over a cycle, from results of an analysis; and the compaction by it.

The paper sees the level area of the autocorrelation fall after its maximum and concludes that
clusters become more compact. Simulated clusters are rigid: what falls there is no compaction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.physics.filling_factor import (
    PAPER_CLUSTER_SIZES,
    paper_cluster_filling,
)
from nanorocks_ros.studies.analysis.results.result_tables import read_columns

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray

# Level areas are taken together over this time, [s]; of a cycle the last part is its end.
_TOGETHER = 2.0
_END = 0.15
# By then clusters have formed in the paper (its figure 8e), [s].
_SETTLED = 6.0, 14.0
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
