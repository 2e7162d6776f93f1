"""Clusters of one tray: sizes from the autocorrelation, with bodies and sticking from tracks."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.records import (
    NS,
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    Interval,
    Measured,
    MeasuredInterval,
    Merge,
    Notice,
    PairCollision,
    Quality,
    SizeStatus,
    SpeedEstimate,
    StickingStatus,
    TrayImage,
    sizes_disagree,
)
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator
from nanorocks_ros.stages.clusters.reading_offset import ReadingOffset
from nanorocks_ros.stages.clusters.sticking_estimator import StickingEstimator
from nanorocks_ros.stages.delays import clusters_after_ns
from nanorocks_ros.stages.stage import RestartingStage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate
    from nanorocks_ros.settings import PipelineSettings

# Interval at which the sticking speed of a cycle is worked out anew.
_UPDATE_NS = NS
# Largest age of a count of bodies that is used for an instant.
_RECENT_NS = NS
# Smallest error of a size, [beads].
_SMALLEST_ERROR = 0.01
# States in which the width has a reading on the curve.
_WITH_READING = (SizeStatus.MEASURED, SizeStatus.BEYOND)

Input = TrayImage | SpeedEstimate | BodyEstimate | Merge | PairCollision
Clusters = ClusterEstimate | Autocorrelation | Notice


class ClusterEstimator(RestartingStage[Input, Clusters]):
    """Joins the autocorrelation of a tray image with the bodies and merges of that instant.

    Estimates come a second after the bodies of their instant, so that they do not depend on the
    order in which records of different kinds come in. An image whose stamp goes back gives out the
    estimates held so far and starts afresh; merges and speeds start afresh with the first speed
    whose stamp goes back.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray

    Attributes
    ----------
    emit_image : bool
        Also emit each :class:`Autocorrelation`, at once.

    Raises
    ------
    ConfigurationError
        For a calibration file that cannot be read, or has no curve of this tray.
    """

    clock = TrayImage

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._images = ClusterAutocorrelator(settings, tray)
        self._sticking = StickingEstimator(settings, tray)
        self._delay_ns = clusters_after_ns(settings.bodies)
        self.reset()

    def _restart(self, stamp_ns: int | None = None) -> None:
        self._images.reset(stamp_ns)
        curve = self._images.curve
        self._offset = ReadingOffset(curve) if curve is not None else None
        # With whether the scale of the picture is wrong.
        self._held: deque[tuple[ClusterEstimate, bool]] = deque()
        # The last one, with its cycle and second.
        self._sticking_speed: tuple[tuple[int, int], StickingEstimate | None] | None = None

    @property
    def emit_image(self) -> bool:
        """Whether each autocorrelation is emitted."""
        return self._images.emit_image

    @emit_image.setter
    def emit_image(self, wanted: bool) -> None:
        self._images.emit_image = wanted

    @property
    def cycles(self) -> tuple[StickingCycle, ...]:
        """Merges and speeds of the cycles since time last went back."""
        return self._sticking.cycles()

    def together(self, cycles: Sequence[StickingCycle]) -> StickingEstimate | None:
        """Sticking speed of several cycles of this tray, also of other recordings."""
        return self._sticking.together(cycles)

    def _process(self, record: Input) -> tuple[Clusters, ...]:
        if not isinstance(record, TrayImage):
            self._sticking.push(record)
            return ()
        records: list[Clusters] = []
        wrong_scale = bool(record.quality & Quality.WRONG_SCALE)
        for result in self._images.push(record):
            if not isinstance(result, ClusterEstimate):
                records.append(result)
                continue
            estimate = _without_size(result) if wrong_scale else result
            self._held.append((estimate, wrong_scale))
        known_ns = record.stamp_ns - self._delay_ns
        while self._held and self._held[0][0].stamp_ns <= known_ns:
            records.append(self._completed(*self._held.popleft()))
        return tuple(records)

    def flush(self) -> tuple[ClusterEstimate, ...]:
        """The estimates that are held back."""
        for result in self._images.flush():
            if isinstance(result, ClusterEstimate):
                self._held.append((result, False))
        held, self._held = self._held, deque()
        return tuple(self._completed(estimate, wrong_scale) for estimate, wrong_scale in held)

    def _interrupted(self) -> tuple[Clusters, ...]:
        return self.flush()

    def _completed(self, estimate: ClusterEstimate, wrong_scale: bool) -> ClusterEstimate:
        cycle, stamp_ns = estimate.cycle, estimate.stamp_ns
        if wrong_scale:
            # Bodies and merges are wrong as well.
            return estimate
        fields: dict[str, Any] = {}
        bodies = self._sticking.bodies(cycle, stamp_ns)
        if bodies is not None and stamp_ns - bodies.stamp_ns <= _RECENT_NS:
            fields = {
                'bodies': bodies.bodies,
                'mean_size': bodies.mean_size.value,
                'weighted_size': bodies.weighted_size,
                'clustered_share': bodies.clustered_share.value,
            }
        onset = self._sticking.onset(cycle, stamp_ns)
        if onset is not None:
            fields['onset'] = onset
        of_cycle = self._sticking_speed_of(cycle, stamp_ns)
        if of_cycle is not None:
            fields |= {
                'sticking_status': StickingStatus(of_cycle.status),
                'sticking_speed': Interval(
                    of_cycle.sticking_speed, of_cycle.lower, of_cycle.upper
                ),
                'sticking_speed_lower_68': of_cycle.lower_68,
                'sticking_speed_upper_68': of_cycle.upper_68,
            }
        of_all = self._sticking.of_all(cycle, stamp_ns)
        if of_all is not None:
            fields |= {
                'mean_sticking_speed': Interval(of_all.sticking_speed, of_all.lower, of_all.upper),
                'mean_sticking_speed_lower_68': of_all.lower_68,
                'mean_sticking_speed_upper_68': of_all.upper_68,
            }
        weighted_size = fields.get('weighted_size', UNKNOWN_MEASURED)
        estimate = self._with_offset(estimate, weighted_size)
        size = _combined(estimate.cluster_size.measured, weighted_size)
        return replace(estimate, combined_size=size, **fields)

    def _with_offset(self, estimate: ClusterEstimate, weighted_size: Measured) -> ClusterEstimate:
        """The estimate with the size by the offset of this camera, as far as that is known."""
        offset, cycle, stamp_ns = self._offset, estimate.cycle, estimate.stamp_ns
        if offset is None:
            return estimate
        offset.follow(cycle, stamp_ns)
        first_merge_ns = self._sticking.first_merge_ns(cycle, stamp_ns)
        if first_merge_ns is not None:
            offset.forget(cycle, first_merge_ns)
        if estimate.size_status not in _WITH_READING:
            return estimate
        reading = offset.curve.reading_of(estimate.level_area, estimate.breadth)
        single = first_merge_ns is None and offset.certainly_single(weighted_size)
        if single:
            offset.learn(reading, stamp_ns)
        of_camera = offset.known()
        if of_camera is None:
            # Of clusters the tracks are less sure than that all beads are single.
            wrong = (
                sizes_disagree(estimate.cluster_size, weighted_size)
                if single
                else offset.curve.excludes(reading, weighted_size)
            )
            return _contradicted(estimate) if wrong else estimate
        size = offset.curve.size_at(reading, of_camera)
        return replace(
            estimate,
            cluster_size=MeasuredInterval(size.size, size.error, size.lower, size.upper),
            size_status=size.status,
        )

    def _sticking_speed_of(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """Sticking speed of the cycle, as of the last full second."""
        whole_ns = stamp_ns - stamp_ns % _UPDATE_NS
        key = cycle, whole_ns
        if self._sticking_speed is None or self._sticking_speed[0] != key:
            self._sticking_speed = key, self._sticking.of_cycle(cycle, whole_ns)
        return self._sticking_speed[1]


def _without_size(estimate: ClusterEstimate) -> ClusterEstimate:
    """The estimate without sizes: in a picture of a wrong scale the size of a bead is unknown."""
    return replace(
        estimate,
        size_status=SizeStatus.NOTHING,
        cluster_size=UNKNOWN_MEASURED_INTERVAL,
    )


def _contradicted(estimate: ClusterEstimate) -> ClusterEstimate:
    """The estimate of which the tracks say that it is wrong: only its interval is left."""
    limits = estimate.cluster_size
    return replace(
        estimate,
        size_status=SizeStatus.CONTRADICTED,
        cluster_size=replace(UNKNOWN_MEASURED_INTERVAL, lower=limits.lower, upper=limits.upper),
    )


def _combined(*sizes: Measured) -> Measured:
    """Mean of the known sizes, weighted by their errors."""
    known = [size for size in sizes if size.known]
    if not known:
        return UNKNOWN_MEASURED
    # An error of 0 would give an infinite weight.
    weights = [1.0 / max(size.error, _SMALLEST_ERROR) ** 2 for size in known]
    mean = sum(w * size.value for w, size in zip(weights, known, strict=True)) / sum(weights)
    return Measured(mean, sum(weights) ** -0.5)
