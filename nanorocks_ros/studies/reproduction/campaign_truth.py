"""The truth of a simulated film: bodies, ten marked beads, and how many beads the tracks hold.

Tested by ``test/studies/reproduction/test_campaign_truth.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.recordings.bag.reader import open_bag
from nanorocks_ros.records import Tracks
from nanorocks_ros.studies.synthetic.film_bag import START_NS
from nanorocks_ros.wire import topics
from nanorocks_ros.wire.bead_truth import beads_from_array

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import BeadsTruth

TRUTH_COLUMNS = (
    'time', 'bodies', 'weighted_size', 'clusters', 'beads_in_clusters', 'marked_speed'
)  # fmt: skip
MARKED = 10
"""Beads of each species that the paper marked by hand ([B19] section 3.1.1)."""
# Interval between two rows of the truth, [s], and between two images whose tracks are kept.
_TRUTH_STEP, _TRACKS_STEP = 0.2, 0.5


class TrackedShares(NamedTuple):
    """Tracked beads after shaking, as shares of the beads that are no grains.

    `detected`: all detections, as the paper counts; `matched`: beads with a detection on them;
    `spurious`: detections on no bead.
    """

    detected: float
    matched: float
    spurious: float


class TrackSampler:
    """Keeps the tracks of one image of a tray in half a second, after the shaking event."""

    def __init__(self) -> None:
        self.tracks: dict[tuple[int, int], Tracks] = {}
        self._next_ns: dict[int, int] = {}

    def __call__(self, record: object) -> None:
        """Keep the record if it is due."""
        if not isinstance(record, Tracks) or record.cycle == 0:
            return
        if record.stamp_ns >= self._next_ns.get(record.tray, 0):
            self._next_ns[record.tray] = record.stamp_ns + round(_TRACKS_STEP * 1e9)
            self.tracks[record.tray, record.stamp_ns] = record


class FilmTruth(NamedTuple):
    """True values of a film.

    `series`: by tray, the columns `TRUTH_COLUMNS` over time; SI, `marked_speed` is the mean
    projected speed of ten beads of each species. `tracked`: `TrackedShares` by tray, as lists;
    trays without tracks are missing.
    """

    series: dict[str, dict[str, list[float]]]
    tracked: dict[str, list[float]]


def film_truth(film: Path, sampled: dict[tuple[int, int], Tracks]) -> FilmTruth:
    """Read the truth of all beads of a film.

    Parameters
    ----------
    film : Path
        Bag of a simulated film.
    sampled : dict
        Of a `TrackSampler`: tracks by tray and stamp.

    Raises
    ------
    RecordingError, FrameError
        When the bag cannot be read.
    """
    trays = load_trays()
    rows: dict[str, list[tuple[float, ...]]] = {}
    shares: dict[str, list[TrackedShares]] = {}
    next_ns: dict[int, int] = {}
    bag = open_bag(film)
    for message in bag.messages([topics.BEADS.absolute(number) for number in trays]):
        number = topics.tray_of(message.topic) or 0
        due = message.log_time_ns >= next_ns.get(number, 0)
        tracks = sampled.get((number, message.log_time_ns))
        if not due and tracks is None:
            continue
        values = bag.deserialize(message).data
        beads = beads_from_array(values, tray=number, epoch_ns=START_NS, where=message.topic)
        if due:
            next_ns[number] = message.log_time_ns + round(_TRUTH_STEP * 1e9)
            rows.setdefault(str(number), []).append(_row(beads))
        if tracks is not None and (share := tracked_shares(tracks, beads, trays[number])):
            shares.setdefault(str(number), []).append(share)
    return FilmTruth(
        series={
            tray: dict(zip(TRUTH_COLUMNS, map(list, zip(*values, strict=True)), strict=True))
            for tray, values in rows.items()
        },
        tracked={tray: np.mean(values, axis=0).tolist() for tray, values in shares.items()},
    )


def _row(beads: BeadsTruth) -> tuple[float, ...]:
    sizes = np.unique(beads.bodies, return_counts=True)[1].astype(float)
    clusters = sizes[sizes > 1.0]
    speeds = beads.projected_speeds
    marked = np.concatenate(
        [speeds[beads.species == species][:MARKED] for species in np.unique(beads.species)]
    )
    return (
        (beads.stamp_ns - START_NS) / 1e9,
        float(sizes.size),
        float(np.sum(sizes**2) / sizes.sum()),
        float(clusters.size),
        float(clusters.sum()),
        float(marked.mean()),
    )


def tracked_shares(tracks: Tracks, beads: BeadsTruth, tray: Tray) -> TrackedShares | None:
    """How many of the beads that are no grains the tracks hold in an image.

    Parameters
    ----------
    tracks : Tracks
    beads : BeadsTruth
        At the same time.
    tray : Tray

    Returns
    -------
    TrackedShares or None
        None where all beads are grains.
    """
    solid = [k for k, species in enumerate(tray.species) if species.properties.shape != 'grain']
    present = np.isin(beads.species, solid)
    detected = tracks.seen & np.isin(tracks.species, solid)
    count = int(present.sum())
    if not count:
        return None
    matches = _matches(
        beads.positions[present, :2], beads.radii[present], tracks.positions[detected]
    )
    detections = int(detected.sum())
    return TrackedShares(detections / count, matches / count, (detections - matches) / count)


def _matches(
    centres: NDArray[np.float64], radii: NDArray[np.float64], detections: NDArray[np.float64]
) -> int:
    """Number of beads with a detection on them, each detection for one bead."""
    if not len(detections):
        return 0
    distances = cdist(centres, detections) / radii[:, np.newaxis]
    rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
    return int((distances[rows, columns] < 1.0).sum())
