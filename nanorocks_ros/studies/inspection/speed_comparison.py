"""Comparison of the speeds of a bag by every method, with the ground truth if it is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import write_rows
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import NS, SpeedEstimate
from nanorocks_ros.settings import with_values
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.results.record_columns import columns_of, word_of
from nanorocks_ros.studies.results.run_provenance import run_provenance

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import GroundTruth
    from nanorocks_ros.settings import PipelineSettings

AUTO = 'auto'
_SPEED = 'mean_projected_speed'
METHODS = 'tracking', 'structure_function', 'binarised_area'
"""The compared methods; `auto` is the one of them that is selected from the data."""

_OF_SPEED = {column.name: column for column in columns_of(SpeedEstimate)}
COLUMNS = (
    Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
    Column(name='method', kind='string', doc='method that was set', words=(AUTO, *METHODS)),
    _OF_SPEED['time'],
    _OF_SPEED['cycle'],
    Column(name='since_shaking', unit='s', doc='time since the shaking event'),
    *(_OF_SPEED[name] for name in (_SPEED, f'{_SPEED}_error', 'window')),
    Column(name='measured_by', kind='string', doc='method that was used', words=METHODS),
    Column(name=f'true_{_SPEED}', unit='m/s', doc='mean of the truth over the window'),
    _OF_SPEED['quality'],
)


@dataclass(slots=True, kw_only=True)
class ComparedSpeeds:
    """Speeds of one tray by every method.

    Parameters
    ----------
    tray : Tray
    speeds : dict of str to list of SpeedEstimate
        By `AUTO` and each of `METHODS`, in order of time.
    truth : list of GroundTruth
        Empty for a real recording.
    """

    tray: Tray
    speeds: dict[str, list[SpeedEstimate]]
    truth: list[GroundTruth] = field(default_factory=list)

    def true_speeds(self, estimates: Sequence[SpeedEstimate]) -> NDArray[np.float64]:
        """The true mean projected speed over the window of each estimate, (n,), [m/s].

        NaN if the truth is not known.
        """
        if not self.truth:
            return np.full(len(estimates), np.nan)
        stamps = np.array([truth.stamp_ns for truth in self.truth], dtype=np.int64)
        sums = np.cumsum([0.0, *(truth.mean_projected_speed for truth in self.truth)])
        middles = np.array([estimate.stamp_ns for estimate in estimates], dtype=np.int64)
        # A stamp on the edge of the window is inside, despite rounding.
        halves = np.array([0.5 * estimate.window * NS + 1e3 for estimate in estimates])
        first = np.searchsorted(stamps, middles - halves)
        last = np.searchsorted(stamps, middles + halves)
        counts = np.maximum(last - first, 1)
        return np.where(last > first, (sums[last] - sums[first]) / counts, np.nan)

    def ratios(self, method: str, cycle: int | None = None) -> NDArray[np.float64]:
        """Estimate / truth, where both are known.

        Parameters
        ----------
        method : str
        cycle : int, optional
            Restrict to this cycle.
        """
        estimates = [
            speed for speed in self.speeds[method] if cycle is None or speed.cycle == cycle
        ]
        values = np.array([estimate.mean_projected_speed.value for estimate in estimates])
        with np.errstate(divide='ignore', invalid='ignore'):
            ratios = values / self.true_speeds(estimates)
        return np.asarray(ratios[np.isfinite(ratios)])

    def chosen(self, cycle: int | None = None) -> dict[str, float]:
        """Fraction of the automatically selected speeds that come from each method."""
        selected = [
            speed.method.name.lower()
            for speed in self.speeds[AUTO]
            if cycle is None or speed.cycle == cycle
        ]
        return {method: selected.count(method) / len(selected) for method in METHODS if selected}

    @property
    def cycles(self) -> list[int]:
        """Cycles with at least one speed."""
        return sorted({speed.cycle for speeds in self.speeds.values() for speed in speeds})


@dataclass(slots=True, kw_only=True)
class BagSpeeds:
    """Speeds of a bag by every method.

    Parameters
    ----------
    epoch_ns : int, [ns]
        Origin of the times in the table.
    trays : dict of int to ComparedSpeeds
    frames : int
    notices : list of str
    """

    epoch_ns: int
    trays: dict[int, ComparedSpeeds]
    frames: int = 0
    notices: list[str] = field(default_factory=list)

    def first_cycle(self) -> int:
        """The first cycle after a shaking event; 0 if there was none."""
        cycles = {cycle for tray in self.trays.values() for cycle in tray.cycles}
        return min(cycles - {0}, default=0)


def compare_speeds(
    path: Path,
    settings: PipelineSettings,
    *,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> BagSpeeds:
    """Measure the speeds of a bag by every method, in one pass.

    Parameters
    ----------
    path : Path
    settings : PipelineSettings
        Its `speed.method` is ignored.
    image_topic : str, optional
    progress : callable, optional
        Called with the number of frames done and the total.

    Raises
    ------
    RecordingError
        If the bag cannot be read or has no camera.
    ConfigurationError
        If the settings are invalid.
    FrameError
        If no frame can be used.
    """
    images = BagImages(path, settings, image_topic)
    truth = images.bag.truth(images.epoch_ns)
    estimators = {
        (number, method): TrayMeasurement(
            with_values(images.settings, {'speed.method': method}, 'speeds'), tray
        )
        for number, tray in images.trays.items()
        for method in (AUTO, *METHODS)
    }
    result = BagSpeeds(
        epoch_ns=images.epoch_ns,
        trays={
            number: ComparedSpeeds(
                tray=tray,
                speeds={method: [] for method in (AUTO, *METHODS)},
                truth=truth.get(number, []),
            )
            for number, tray in images.trays.items()
        },
    )
    for shot in images.shots(progress):
        for image in shot.images:
            for method, speeds in result.trays[image.tray].speeds.items():
                records = estimators[image.tray, method].push(image)
                speeds += [record for record in records if isinstance(record, SpeedEstimate)]
    result.frames = images.frames
    result.notices = images.notices
    return result


def write_speeds(path: Path, bag_speeds: BagSpeeds) -> None:
    """Write all speeds as CSV, with the truth over the window of each.

    Raises
    ------
    RecordingError
        If the file cannot be written.
    """
    provenance = {**run_provenance(), 'epoch_ns': bag_speeds.epoch_ns}
    write_rows(path, COLUMNS, _rows(bag_speeds), provenance)


def _rows(bag_speeds: BagSpeeds) -> Iterator[tuple[object, ...]]:
    for number, tray in bag_speeds.trays.items():
        for method, speeds in tray.speeds.items():
            for speed, true in zip(speeds, tray.true_speeds(speeds).tolist(), strict=True):
                start = speed.cycle_start_ns
                yield (
                    number,
                    method,
                    (speed.stamp_ns - bag_speeds.epoch_ns) / NS,
                    speed.cycle,
                    float('nan') if start is None else (speed.stamp_ns - start) / NS,
                    speed.mean_projected_speed.value,
                    speed.mean_projected_speed.error,
                    speed.window,
                    word_of(speed.method),
                    true,
                    word_of(speed.quality),
                )
