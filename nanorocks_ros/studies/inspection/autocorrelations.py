"""Autocorrelations of one cycle of a bag, the cluster sizes from them, and the true sizes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import ConfigurationError, FitError, RecordingError
from nanorocks_ros.outputs.tables.table_columns import Column
from nanorocks_ros.outputs.tables.table_files import write_rows
from nanorocks_ros.physics.paper_clusters import (
    PAPER_TABLE_3,
    paper_calibration,
    paper_onset,
)
from nanorocks_ros.records import NS, Autocorrelation, ClusterEstimate, Notice
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.libraries.cluster_films import cluster_sizes
from nanorocks_ros.studies.results.record_columns import columns_of, record_arrays
from nanorocks_ros.studies.results.run_provenance import run_provenance
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.bead_truth import beads_from_array
from nanorocks_ros.wire.flat_records import flat_value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.settings import PipelineSettings

# Time at the end of a cycle over which the paper averages the area of its clusters, [s].
_END = 2.0
# Time after the shaking event at which the beads fly and none sticks yet, [s].
_FLYING = 0.5
_ESTIMATED = (
    *('level_area', 'breadth', 'axes_ratio', 'direction'),
    *('cluster_size', 'cluster_size_error', 'cluster_size_lower', 'cluster_size_upper'),
    'size_status',
)
_OF_CLUSTERS = {column.name: column for column in columns_of(ClusterEstimate)}
COLUMNS = (
    Column(name='tray', kind='int64', unit='1', doc='number of the tray'),
    _OF_CLUSTERS['time'],
    Column(name='since_shaking', unit='s', doc='time since the shaking event'),
    *(_OF_CLUSTERS[name] for name in _ESTIMATED),
    Column(name='paper_cluster_size', unit='1', doc="size by the paper's linear calibration"),
    Column(name='true_cluster_size', unit='1', doc='true weight-averaged size'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """A tray image and its autocorrelation.

    Parameters
    ----------
    since : float, [s]
        Time since the shaking event.
    gray : ndarray of uint8, (rows, columns)
    values : ndarray of float32, (rows, columns)
        Autocorrelation, centred.
    """

    since: float
    gray: NDArray[np.uint8]
    values: NDArray[np.float32]


@dataclass(slots=True, kw_only=True)
class CycleClusters:
    """Clusters of one tray over one cycle.

    Parameters
    ----------
    tray : Tray
    start_ns : int, [ns]
        Stamp of the shaking event; without one, of the first image.
    estimates : list of ClusterEstimate
    snapshots : list of Snapshot
        Soon after the shaking event, and at the end.
    truth : ndarray, (n, 3)
        Time since the start [s], weight-averaged size, and beads per cluster of two or more (NaN
        if there is none); empty if the true bodies are not known.
    """

    tray: Tray
    start_ns: int
    estimates: list[ClusterEstimate] = field(default_factory=list)
    snapshots: list[Snapshot] = field(default_factory=list)
    truth: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the estimates since the start, (n,), [s]."""
        return np.array([(estimate.stamp_ns - self.start_ns) / NS for estimate in self.estimates])

    def column(self, name: str) -> NDArray[np.float64]:
        """An element of the arrays of all estimates, by name, (n,)."""
        return np.array([float(flat_value(estimate, name)) for estimate in self.estimates])

    def true_sizes(self) -> NDArray[np.float64]:
        """The true weight-averaged size at each estimate, (n,); NaN if it is not known."""
        if not len(self.truth):
            return np.full(len(self.estimates), np.nan)
        sizes: NDArray[np.float64] = np.interp(self.times, self.truth[:, 0], self.truth[:, 1])
        return sizes

    def counted(self) -> float:
        """Beads per cluster at the end: the truth, or the manual count of the paper (table 3)."""
        if len(self.truth) and math.isfinite(self.truth[-1, 2]):
            return float(self.truth[-1, 2])
        row = PAPER_TABLE_3.get(self.tray.number)
        return math.nan if row is None else row.beads_per_cluster

    def paper_sizes(self) -> NDArray[np.float64]:
        """Sizes by the paper's linear calibration at the end of this cycle, (n,).

        NaN if there are no areas or the number of beads per cluster is not known.
        """
        areas, times = self.column('level_area'), self.times
        try:
            line = paper_calibration(areas[times >= times[-1] - _END], self.counted())
        except ConfigurationError:
            return np.full(areas.size, np.nan)
        return line.size(areas)

    def paper_onset(self) -> float:
        """Onset of clustering by the paper's rule, since the start, [s]; NaN if there is none."""
        try:
            return paper_onset(self.times, self.column('level_area'))
        except FitError:
            return math.nan

    def true_onset(self) -> float:
        """Time of the first sticking, since the start, [s]; NaN if there is none or unknown."""
        stuck = self.truth[(self.truth[:, 0] >= 0.0) & (self.truth[:, 1] > 1.0), 0]
        return float(stuck[0]) if stuck.size else math.nan


@dataclass(slots=True, kw_only=True)
class BagClusters:
    """Clusters of one cycle of a bag.

    Parameters
    ----------
    epoch_ns : int, [ns]
        Origin of the times in the table.
    cycle : int
    trays : dict of int to CycleClusters
    notices : list of str
    """

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
    """Compute the autocorrelations of one cycle of a bag.

    Parameters
    ----------
    path : Path
    settings : PipelineSettings
    cycle : int
        Number of shaking events before it; 0 before the first.
    image_topic : str, optional
    progress : callable, optional
        Called with the number of frames done and the total.

    Raises
    ------
    RecordingError
        If the bag cannot be read, or has no camera or not that cycle.
    ConfigurationError
        If the settings are invalid.
    FrameError
        If no frame can be used.
    """
    images = BagImages(path, settings, image_topic)
    stages = {
        number: ClusterAutocorrelator(images.settings, tray)
        for number, tray in images.trays.items()
    }
    clusters: dict[int, CycleClusters] = {}
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
            tray_clusters = clusters.setdefault(
                image.tray, CycleClusters(tray=tray, start_ns=start)
            )
            _add_records(tray_clusters, image.gray, records)
    if not clusters:
        raise RecordingError(
            images.bag.where,
            f'holds no cycle {cycle}',
            f'name another with --cycle: {", ".join(str(number) for number in sorted(cycles))} '
            '(0: before the first shaking event)',
        )
    for number, tray_clusters in clusters.items():
        tray_clusters.truth = _truth(images, number, cycle, tray_clusters.start_ns)
    return BagClusters(
        epoch_ns=images.epoch_ns, cycle=cycle, trays=clusters, notices=[*images.notices, *notices]
    )


def _add_records(
    clusters: CycleClusters, gray: NDArray[np.uint8], records: tuple[object, ...]
) -> None:
    for record in records:
        if isinstance(record, ClusterEstimate):
            clusters.estimates.append(record)
        elif isinstance(record, Autocorrelation):
            since = (record.stamp_ns - clusters.start_ns) / NS
            snapshot = Snapshot(since=since, gray=gray, values=record.values)
            # Keep the first snapshot of flying beads, and the last one.
            if not clusters.snapshots or clusters.snapshots[0].since < _FLYING:
                clusters.snapshots = [snapshot]
            else:
                clusters.snapshots = [clusters.snapshots[0], snapshot]


def _truth(images: BagImages, tray: int, cycle: int, start_ns: int) -> NDArray[np.float64]:
    """True sizes from the bodies in the bag, as `CycleClusters.truth`."""
    reader, name = images.bag.reader, topics.BEADS.absolute(tray)
    rows = []
    for message in reader.messages([name]) if name in reader.topics else ():
        values = reader.deserialize(message).data
        beads = beads_from_array(values, tray=tray, epoch_ns=images.epoch_ns, where=name)
        if beads.cycle == cycle:
            sizes = np.unique(beads.bodies, return_counts=True)[1]
            clusters = sizes[sizes > 1]
            rows.append(
                (
                    (beads.stamp_ns - start_ns) / NS,
                    cluster_sizes(beads.bodies)[0],
                    float(clusters.mean()) if clusters.size else math.nan,
                )
            )
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def write_clusters(path: Path, clusters: BagClusters) -> None:
    """Write all estimates as CSV, with the size by the paper's method and the true size.

    Raises
    ------
    RecordingError
        If the file cannot be written.
    """
    provenance = {**run_provenance(), 'epoch_ns': clusters.epoch_ns}
    write_rows(path, COLUMNS, _rows(clusters), provenance)


def _rows(clusters: BagClusters) -> Iterator[tuple[object, ...]]:
    for number, tray in clusters.trays.items():
        estimated = record_arrays(ClusterEstimate, tray.estimates, clusters.epoch_ns)
        columns = (
            estimated['time'],
            tray.times,
            *(estimated[name] for name in _ESTIMATED),
            tray.paper_sizes(),
            tray.true_sizes(),
        )
        for row in zip(*(column.tolist() for column in columns), strict=True):
            yield number, *row
