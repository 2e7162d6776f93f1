"""The autocorrelations of one cycle of a bag, the cluster sizes they give, and the true ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.outputs.csv_tables import write_csv
from nanorocks_ros.physics.paper_clusters import (
    PAPER_TABLE_3,
    paper_calibration,
    paper_onset,
)
from nanorocks_ros.records import Autocorrelation, ClusterEstimate, Notice
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.libraries.cluster_films import cluster_sizes
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.array_layouts import NS
from nanorocks_ros.wire.bead_truth import beads_from_array
from nanorocks_ros.wire.flat_records import flat_value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Of a cycle, for the mean area that the paper takes for that of its clusters, [s].
_END = 2.0
# After the shaking event, [s]: the beads fly, and nothing sticks yet.
_FLYING = 0.5
_COLUMNS = {
    'tray': '1',
    'time': 's',
    'since_shaking': 's',
    'level_area': 'm^2',
    'breadth': '1',
    'axes_ratio': '1',
    'direction': 'rad',
    'cluster_size': '1',
    'cluster_size_error': '1',
    'cluster_size_lower': '1',
    'cluster_size_upper': '1',
    'size_status': '1',
    'paper_cluster_size': '1',
    'true_cluster_size': '1',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A tray image and its autocorrelation."""

    since: float
    gray: NDArray[np.uint8]
    values: NDArray[np.float32]


@dataclass(slots=True, kw_only=True)
class CycleClusters:
    """What the autocorrelations of one tray show over one cycle.

    Parameters
    ----------
    tray : Tray
    start_ns : int
        The shaking event; without one the first picture.
    estimates : list of ClusterEstimate
    snapshots : list of Snapshot
        Soon after the shaking event, and the last.
    truth : ndarray (n, 3)
        Time since the start [s], weight-averaged size, and beads per cluster of two or more (NaN
        without any); empty where bodies are not known.
    """

    tray: Tray
    start_ns: int
    estimates: list[ClusterEstimate] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)
    truth: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def times(self) -> NDArray[np.float64]:
        """Of the estimates, since the start, (n,), [s]."""
        return np.array([(estimate.stamp_ns - self.start_ns) / NS for estimate in self.estimates])

    def column(self, name: str) -> NDArray[np.float64]:
        """An element of the arrays of all estimates, by name, (n,)."""
        return np.array([float(flat_value(estimate, name)) for estimate in self.estimates])

    def true_sizes(self) -> NDArray[np.float64]:
        """The true weight-averaged size at each estimate, (n,); NaN where not known."""
        if not len(self.truth):
            return np.full(len(self.estimates), np.nan)
        found: NDArray[np.float64] = np.interp(self.times, self.truth[:, 0], self.truth[:, 1])
        return found

    def counted(self) -> float:
        """Beads per cluster at the end, as the paper counts by hand: the truth, or table 3."""
        if len(self.truth) and math.isfinite(self.truth[-1, 2]):
            return float(self.truth[-1, 2])
        row = PAPER_TABLE_3.get(self.tray.number)
        return math.nan if row is None else row.beads_per_cluster

    def paper_sizes(self) -> NDArray[np.float64]:
        """Sizes by the paper's straight line through the end of this cycle, (n,).

        NaN where nothing was seen, or nothing is known that could have been counted.
        """
        areas, times = self.column('level_area'), self.times
        try:
            line = paper_calibration(areas[times >= times[-1] - _END], self.counted())
        except ConfigurationError:
            return np.full(areas.size, np.nan)
        return line.size(areas)

    def paper_onset(self) -> float:
        """Onset of clustering by the paper's rule, since the start, [s]; NaN without one."""
        try:
            return paper_onset(self.times, self.column('level_area'))
        except FitError:
            return math.nan

    def true_onset(self) -> float:
        """When the first beads stuck, since the start, [s]; NaN where none did or unknown."""
        stuck = self.truth[(self.truth[:, 0] >= 0.0) & (self.truth[:, 1] > 1.0), 0]
        return float(stuck[0]) if stuck.size else math.nan


@dataclass(slots=True, kw_only=True)
class BagClusters:
    """Of each tray of a bag, one cycle."""

    epoch_ns: int
    cycle: int
    trays: dict[int, CycleClusters]
    notices: list[str] = field(default_factory=list)


def cycle_clusters(
    path: Path,
    settings: PipelineSettings,
    *,
    cycle: int = 1,
    image_topic: str = '',
    progress: Callable[[int, int], None] | None = None,
) -> BagClusters:
    """Follow the autocorrelations of one cycle of a bag.

    Parameters
    ----------
    path : Path
    settings : PipelineSettings
    cycle : int
        Shaking events so far; 0 before the first.
    image_topic : str, optional
    progress : callable, optional
        Called with the frames done and the frames there are.

    Raises
    ------
    RecordingError
        When the bag cannot be read, holds no camera, or not that cycle.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    """
    images = BagImages(path, settings, image_topic)
    stages = {n: ClusterAutocorrelator(images.settings, one) for n, one in images.trays.items()}
    found: dict[int, CycleClusters] = {}
    notices = []
    cycles: set[int] = set()
    for shot in images.shots(progress):
        for image in shot.images:
            cycles.add(image.cycle or 0)
            stage = stages[image.tray]
            stage.emit_image = True
            records = stage.push(image)
            notices += [record.text for record in records if isinstance(record, Notice)]
            if image.cycle != cycle or not records:
                continue
            start = image.stamp_ns if image.cycle_start_ns is None else image.cycle_start_ns
            tray = images.trays[image.tray]
            one = found.setdefault(image.tray, CycleClusters(tray=tray, start_ns=start))
            _keep(one, image.gray, records)
    if not found:
        raise RecordingError(
            images.bag.where,
            f'holds no cycle {cycle}',
            f'name another with --cycle: {", ".join(str(one) for one in sorted(cycles))} '
            '(0: before the first shaking event)',
        )
    for number, one in found.items():
        one.truth = _truth(images, number, cycle, one.start_ns)
    return BagClusters(
        epoch_ns=images.epoch_ns, cycle=cycle, trays=found, notices=[*images.notices, *notices]
    )


def _keep(found: CycleClusters, gray: NDArray[np.uint8], records: tuple[object, ...]) -> None:
    for record in records:
        if isinstance(record, ClusterEstimate):
            found.estimates.append(record)
        elif isinstance(record, Autocorrelation):
            since = (record.stamp_ns - found.start_ns) / NS
            shot = Snapshot(since=since, gray=gray, values=record.values)
            # The first, until the beads fly; then the last there is.
            if not found.snapshots or found.snapshots[0].since < _FLYING:
                found.snapshots = [shot]
            else:
                found.snapshots = [found.snapshots[0], shot]


def _truth(images: BagImages, tray: int, cycle: int, start_ns: int) -> NDArray[np.float64]:
    """Sizes by the bodies that the simulator of the scene knows, as `CycleClusters.truth`."""
    reader, name = images.bag.reader, topics.BEADS.absolute(tray)
    rows = []
    for message in reader.messages([name]) if name in reader.topics else ():
        values = reader.deserialize(message).data
        one = beads_from_array(values, tray=tray, epoch_ns=images.epoch_ns, where=name)
        if one.cycle == cycle:
            sizes = np.unique(one.bodies, return_counts=True)[1]
            many = sizes[sizes > 1]
            rows.append(
                (
                    (one.stamp_ns - start_ns) / NS,
                    cluster_sizes(one.bodies)[0],
                    float(many.mean()) if many.size else math.nan,
                )
            )
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def write_clusters(path: Path, found: BagClusters) -> None:
    """Write every estimate as a table, CSV, with the paper's size and the true one.

    Raises
    ------
    RecordingError
        When the file cannot be written.
    """
    write_csv(path, list(_COLUMNS), list(_COLUMNS.values()), _rows(found))


def _rows(found: BagClusters) -> Iterator[tuple[object, ...]]:
    for number, tray in found.trays.items():
        paper = tray.paper_sizes().tolist()
        times, truth = tray.times.tolist(), tray.true_sizes().tolist()
        for since, by_paper, true, estimate in zip(
            times, paper, truth, tray.estimates, strict=True
        ):
            yield (
                number,
                (estimate.stamp_ns - found.epoch_ns) / NS,
                since,
                estimate.level_area,
                estimate.breadth,
                estimate.axes_ratio,
                estimate.direction,
                estimate.cluster_size.value,
                estimate.cluster_size.error,
                estimate.cluster_size.lower,
                estimate.cluster_size.upper,
                estimate.size_status.name.lower(),
                by_paper,
                true,
            )
