"""Analysis of a bag as fast as the machine can, by the same stages as the live graph."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nanorocks_ros.limits import PAUSE_SECONDS
from nanorocks_ros.outputs.disk_list import Spool, SpoolFile
from nanorocks_ros.pipeline.composition import Pipeline, Wanted
from nanorocks_ros.records import (
    NS,
    BodyEstimate,
    ClusterEstimate,
    CorEstimate,
    GroundTruth,
    Merge,
    Notice,
    PairCollision,
    Rebound,
    SpeedEstimate,
)
from nanorocks_ros.settings import PriorSettings
from nanorocks_ros.studies.analysis.bag_images import PreprocessedFrames, open_camera
from nanorocks_ros.studies.analysis.recognition_verdicts import recognition_verdicts
from nanorocks_ros.studies.analysis.scene_frames import scene_frames
from nanorocks_ros.wire.products import MEASURED, is_measured

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from nanorocks_ros.errors import FrameError
    from nanorocks_ros.inference.cycle_likelihoods import CycleLikelihoods
    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.pipeline.composition import Result
    from nanorocks_ros.records import ArrayRecord, RecordType
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.analysis.recognition_verdicts import Verdict


# A gap of more than this many usual intervals means that frames are missing.
_GAP = 1.5


class TrayResults:
    """Everything that was measured in one tray, in order of time.

    Parameters
    ----------
    records : iterable of ArrayRecord
        Of any kinds that the register of products calls measured.
    truth : list of GroundTruth
        Of a simulated recording.
    spool_file : SpoolFile, optional
        Where the records are kept; None: in memory.

    Attributes
    ----------
    evidence : CycleLikelihoods or None
        What the cycles say of the restitutions, so that cycles of other recordings can be added.
    sticking : tuple of StickingCycle
        What they say of the sticking speed.
    verdicts : tuple of Verdict
        How well each species was recognised; empty where beads were not tracked.
    """

    def __init__(
        self,
        records: Iterable[ArrayRecord] = (),
        *,
        truth: list[GroundTruth] | None = None,
        spool_file: SpoolFile | None = None,
    ) -> None:
        self._by_type: dict[type, Any] = {
            product.record: [] if spool_file is None else Spool(spool_file) for product in MEASURED
        }
        self.truth = truth or []
        self.evidence: CycleLikelihoods | None = None
        self.sticking: tuple[StickingCycle, ...] = ()
        self.verdicts: tuple[Verdict, ...] = ()
        for record in records:
            self.add(record)

    def add(self, record: ArrayRecord) -> None:
        """Append a record to those of its kind."""
        self._by_type[type(record)].append(record)

    def of(self, record_type: type[RecordType]) -> Sequence[RecordType]:
        """The records of one kind, in the order in which they were added."""
        records: Sequence[RecordType] = self._by_type[record_type]
        return records

    @property
    def speeds(self) -> Sequence[SpeedEstimate]:
        """Mean projected speeds."""
        return self.of(SpeedEstimate)

    @property
    def clusters(self) -> Sequence[ClusterEstimate]:
        """Cluster sizes and sticking speeds."""
        return self.of(ClusterEstimate)

    @property
    def cors(self) -> Sequence[CorEstimate]:
        """Coefficients of restitution."""
        return self.of(CorEstimate)

    @property
    def rebounds(self) -> Sequence[Rebound]:
        """Rebounds from walls."""
        return self.of(Rebound)

    @property
    def collisions(self) -> Sequence[PairCollision]:
        """Collisions of two beads."""
        return self.of(PairCollision)

    @property
    def bodies(self) -> Sequence[BodyEstimate]:
        """Counts of single beads and clusters."""
        return self.of(BodyEstimate)

    @property
    def merges(self) -> Sequence[Merge]:
        """Merges of two beads."""
        return self.of(Merge)


@dataclass(slots=True, kw_only=True)
class Analysis:
    """Everything that was measured in a bag.

    Parameters
    ----------
    epoch_ns : int
        What times count from.
    stamps_ns : array of 64-bit int, [ns]
        Of the frames analysed.
    trays : dict of int to TrayResults
    notices : list of str
        What the user should know: salvage, late frames, restarts.
    complete : bool
        Whether every frame was analysed.
    error : FrameError or None
        Why the first of the frames that could not be used could not; the others were.
    refused : int
        Frames that could not be used.
    metadata : dict of str to str
        Provenance that the recording holds.
    include_inconsistent : bool
        Whether decays that contacts contradict are counted in the means.
    prior : PriorSettings
        Priors of the restitutions, and systematic errors.
    """

    epoch_ns: int
    trays: dict[int, TrayResults]
    stamps_ns: array[int] = field(default_factory=lambda: array('q'))
    notices: list[str] = field(default_factory=list)
    complete: bool = True
    error: FrameError | None = None
    refused: int = 0
    metadata: dict[str, str] = field(default_factory=dict)
    include_inconsistent: bool = False
    prior: PriorSettings = field(default_factory=PriorSettings)

    @property
    def usable(self) -> bool:
        """Whether the beads of all trays were recognised well enough to use the result."""
        return all(
            verdict.usable for results in self.trays.values() for verdict in results.verdicts
        )

    @property
    def frames(self) -> int:
        """Frames analysed."""
        return len(self.stamps_ns)

    @property
    def seconds(self) -> float:
        """Time from the first frame to the last, [s]."""
        if not self.stamps_ns:
            return 0.0
        return (max(self.stamps_ns) - min(self.stamps_ns)) / NS

    @property
    def frames_lost(self) -> int:
        """Frames missing from the sequence, judged by the usual interval between two."""
        steps = np.diff(np.array(self.stamps_ns, dtype=np.int64)).astype(np.float64)
        steps = steps[steps > 0]
        if steps.size == 0:
            return 0
        usual = float(np.median(steps))
        # A clock that was set is no gap.
        gaps = steps[(steps > _GAP * usual) & (steps <= PAUSE_SECONDS.value * NS)]
        return int(np.sum(np.rint(gaps / usual) - 1))


def analyse(
    path: str | Path,
    settings: PipelineSettings,
    *,
    image_topic: str = '',
    progress: Progress | None = None,
    scratch: Path | None = None,
    observer: Callable[[Result], None] | None = None,
) -> Analysis:
    """Push every frame of a bag through the pipeline.

    Parameters
    ----------
    path : str or Path
    settings : PipelineSettings
    image_topic : str, optional
        Where the bag's camera has another name than the graph's.
    progress : callable, optional
        Called with the frames done and the frames there are.
    scratch : Path, optional
        Folder on a disk with room for the records, which are kept in memory otherwise.
    observer : callable, optional
        Called with every result of the frames, tracks included, most of which are not kept.

    Returns
    -------
    Analysis
        Holds what could be analysed even if a frame in the middle could not.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    """
    bag, epoch_ns, view = open_camera(path, settings, image_topic)
    pipeline = Pipeline(settings, bag.where, view)
    lessons = scene_frames(Path(path), settings, image_topic=image_topic, progress=progress)
    for number, lesson in lessons.items():
        pipeline.cooling_trays[number].measurement.learn(lesson)
    truth = bag.truth(epoch_ns)
    result = Analysis(
        epoch_ns=epoch_ns,
        trays=_empty(settings.trays, truth, scratch),
        complete=bag.reader.complete,
        metadata=bag.reader.metadata,
        include_inconsistent=settings.cooling.include_inconsistent,
        prior=settings.prior,
    )
    frames = PreprocessedFrames(bag, pipeline.preprocessor)
    wanted = dict.fromkeys(settings.trays, Wanted(tracks=observer is not None))
    for shot in frames.shots(progress):
        if shot.images:
            result.stamps_ns.append(shot.frame.stamp_ns)
        records = pipeline.follow(shot.records, wanted)
        _keep(result, records)
        if observer is not None:
            for record in records:
                observer(record)
    result.error, result.refused = frames.error, frames.refused
    result.notices += frames.lens_notices
    duplicates = pipeline.preprocessor.duplicates
    if duplicates:
        result.notices.append(f'{bag.where}: {duplicates} frames were stored twice and left out')
    if result.refused:
        result.notices.append(f'{bag.where}: {result.refused} frames could not be used')
        result.complete = False
    _keep(result, pipeline.flush())
    for number, stages in pipeline.cooling_trays.items():
        result.trays[number].evidence = stages.restitution.evidence
        result.trays[number].sticking = stages.clusters.cycles
        counts = stages.measurement.recognition.counts()
        result.trays[number].verdicts = recognition_verdicts(counts)
    # Known only after reading: where a damaged bag ends.
    result.notices[:0] = [*bag.reader.notices, *bag.notices]
    result.complete = result.complete and bag.reader.complete
    return result


def _empty(
    trays: Iterable[int], truth: Mapping[int, list[GroundTruth]], scratch: Path | None
) -> dict[int, TrayResults]:
    """Empty results of each tray."""
    file = None if scratch is None else SpoolFile(scratch)
    return {tray: TrayResults(truth=truth.get(tray), spool_file=file) for tray in trays}


def _keep(result: Analysis, records: Iterable[Result]) -> None:
    for record in records:
        if isinstance(record, Notice):
            result.notices.append(record.text)
        elif is_measured(record):
            result.trays[record.tray].add(record)
