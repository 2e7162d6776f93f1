"""The speed of a bag by every method at once, beside each other and beside the truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.outputs.csv_tables import write_csv
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import SpeedEstimate
from nanorocks_ros.settings import with_values
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.wire.array_layouts import NS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import GroundTruth
    from nanorocks_ros.settings import PipelineSettings

AUTO = 'auto'
METHODS = 'tracking', 'structure_function', 'binarised_area'
"""What is compared; `auto` is whichever of them is chosen from the data."""

_COLUMNS = {
    'tray': '1',
    'method': '1',
    'time': 's',
    'cycle': '1',
    'since_shaking': 's',
    'mean_projected_speed': 'm/s',
    'mean_projected_speed_error': 'm/s',
    'window': 's',
    'measured_by': '1',
    'true_mean_projected_speed': 'm/s',
    'quality': '1',
}


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

    def true_speeds(self, found: Sequence[SpeedEstimate]) -> NDArray[np.float64]:
        """The true mean projected speed over the window of each estimate, (n,), [m/s].

        NaN where the truth is not known.
        """
        if not self.truth:
            return np.full(len(found), np.nan)
        stamps = np.array([truth.stamp_ns for truth in self.truth], dtype=np.int64)
        sums = np.cumsum([0.0, *(truth.mean_projected_speed for truth in self.truth)])
        middles = np.array([estimate.stamp_ns for estimate in found], dtype=np.int64)
        # A stamp on the edge is inside, whatever its last digits.
        halves = np.array([0.5 * estimate.window * NS + 1e3 for estimate in found])
        first = np.searchsorted(stamps, middles - halves)
        last = np.searchsorted(stamps, middles + halves)
        counts = np.maximum(last - first, 1)
        return np.where(last > first, (sums[last] - sums[first]) / counts, np.nan)

    def ratios(self, method: str, cycle: int | None = None) -> NDArray[np.float64]:
        """Estimates over the truth, those of which both are known.

        Parameters
        ----------
        method : str
        cycle : int, optional
            Of this cycle alone.
        """
        estimates = [
            speed for speed in self.speeds[method] if cycle is None or speed.cycle == cycle
        ]
        values = np.array([estimate.mean_projected_speed.value for estimate in estimates])
        with np.errstate(divide='ignore', invalid='ignore'):
            ratios = values / self.true_speeds(estimates)
        return np.asarray(ratios[np.isfinite(ratios)])

    def chosen(self, cycle: int | None = None) -> dict[str, float]:
        """Share of the speeds chosen from the data that each method gave."""
        found = [
            speed.method.name.lower()
            for speed in self.speeds[AUTO]
            if cycle is None or speed.cycle == cycle
        ]
        return {method: found.count(method) / len(found) for method in METHODS if found}

    @property
    def cycles(self) -> list[int]:
        """Cycles in which anything was measured."""
        return sorted({estimate.cycle for found in self.speeds.values() for estimate in found})


@dataclass(slots=True, kw_only=True)
class BagSpeeds:
    """Speeds of a bag by every method.

    Parameters
    ----------
    epoch_ns : int
        What times count from.
    trays : dict of int to ComparedSpeeds
    frames : int
    notices : list of str
    """

    epoch_ns: int
    trays: dict[int, ComparedSpeeds]
    frames: int = 0
    notices: list[str] = field(default_factory=list)

    def first_cycle(self) -> int:
        """The first cycle after a shaking event; 0 where there was none."""
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
        Its `speed.method` does not matter.
    image_topic : str, optional
    progress : callable, optional
        Called with the frames done and the frames there are.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
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
    found = BagSpeeds(
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
            for method, speeds in found.trays[image.tray].speeds.items():
                records = estimators[image.tray, method].push(image)
                speeds += [record for record in records if isinstance(record, SpeedEstimate)]
    found.frames = images.frames
    found.notices = images.notices
    return found


def write_speeds(path: Path, found: BagSpeeds) -> None:
    """Write every estimate as a table, CSV, with the truth over its window.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    write_csv(path, list(_COLUMNS), list(_COLUMNS.values()), _rows(found))


def _rows(found: BagSpeeds) -> Iterator[tuple[object, ...]]:
    for number, tray in found.trays.items():
        for method, speeds in tray.speeds.items():
            for speed, true in zip(speeds, tray.true_speeds(speeds).tolist(), strict=True):
                start = speed.cycle_start_ns
                yield (
                    number,
                    method,
                    (speed.stamp_ns - found.epoch_ns) / NS,
                    speed.cycle,
                    float('nan') if start is None else (speed.stamp_ns - start) / NS,
                    speed.mean_projected_speed.value,
                    speed.mean_projected_speed.error,
                    speed.window,
                    speed.method.name.lower(),
                    true,
                    '+'.join(speed.quality.names()),
                )
