"""All that is known of the clusters of one tray at an instant, by pictures and by tracks."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from nanorocks_ros.records import (
    UNKNOWN_MEASURED,
    UNKNOWN_MEASURED_INTERVAL,
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    Interval,
    Measured,
    Merge,
    Notice,
    Quality,
    SizeStatus,
    SpeedEstimate,
    StickingStatus,
    TrayImage,
)
from nanorocks_ros.stages.clusters.correlation_width import ClusterAutocorrelator
from nanorocks_ros.stages.clusters.sticking_estimator import StickingMeter
from nanorocks_ros.stages.preprocess.shake_detection import NS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.inference.sticking.sticking_cycle import StickingCycle
    from nanorocks_ros.inference.sticking.sticking_speed import StickingEstimate
    from nanorocks_ros.settings import PipelineSettings

# What tracks say of an instant is known a second later; another one is for messages on their way.
_HELD_NS = 2 * NS
# The sticking speed of a cycle is worked out anew so often.
_UPDATE_NS = NS
# Counts of bodies further back than this say nothing of the instant.
_RECENT_NS = NS
# A size is not known better, [beads].
_LEAST_ERROR = 0.01

Clusters = ClusterEstimate | Autocorrelation | Notice


class ClusterEstimator:
    """Puts together the autocorrelation of a tray image and what tracks say of that instant.

    Estimates come two seconds after their instant, so that they do not depend on the order in
    which records of different kinds come in.

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

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._images = ClusterAutocorrelator(settings, tray)
        self._sticking = StickingMeter(settings, tray)
        # With whether the scale of the picture is wrong.
        self._held: deque[tuple[ClusterEstimate, bool]] = deque()
        self._last_ns: int | None = None
        self._of_cycle: tuple[tuple[int, int], StickingEstimate | None] | None = None

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
        return self._sticking.seen()

    def together(self, cycles: Sequence[StickingCycle]) -> StickingEstimate | None:
        """What cycles of this tray say of the sticking speed, also such of other recordings."""
        return self._sticking.together(cycles)

    def push(
        self, record: TrayImage | SpeedEstimate | BodyEstimate | Merge
    ) -> tuple[Clusters, ...]:
        """Take the next record; estimates of the instant two seconds before an image."""
        if not isinstance(record, TrayImage):
            self._sticking.push(record)
            return ()
        found: list[Clusters] = []
        if self._last_ns is not None and record.stamp_ns <= self._last_ns:
            found += self.flush()
        self._last_ns = record.stamp_ns
        wrong_scale = bool(record.quality & Quality.WRONG_SCALE)
        for one in self._images.push(record):
            if isinstance(one, ClusterEstimate):
                self._held.append((_without_size(one) if wrong_scale else one, wrong_scale))
            else:
                found.append(one)
        while self._held and record.stamp_ns - self._held[0][0].stamp_ns >= _HELD_NS:
            found.append(self._completed(*self._held.popleft()))
        return tuple(found)

    def flush(self) -> tuple[ClusterEstimate, ...]:
        """The estimates of the last two seconds."""
        left, self._held = list(self._held), deque()
        return tuple(self._completed(*one) for one in left)

    def _completed(self, estimate: ClusterEstimate, wrong_scale: bool) -> ClusterEstimate:
        cycle, stamp_ns = estimate.cycle, estimate.stamp_ns
        if wrong_scale:
            # Nor are beads and merges what they seem to be.
            return estimate
        fields: dict[str, Any] = {}
        bodies = self._sticking.bodies(cycle, stamp_ns)
        if bodies is not None and stamp_ns - bodies.stamp_ns <= _RECENT_NS:
            fields = {
                'bodies': Measured(bodies.bodies, bodies.bodies_error),
                'mean_size': bodies.mean_size,
                'weighted_size': Measured(bodies.weighted_size, bodies.weighted_size_error),
                'clustered_share': bodies.clustered_share,
            }
        onset = self._sticking.onset(cycle, stamp_ns)
        if onset is not None:
            fields['onset'] = onset
        of_cycle = self._of(cycle, stamp_ns)
        if of_cycle is not None:
            fields |= {
                'sticking_status': StickingStatus(of_cycle.status),
                'sticking_speed': Interval(
                    of_cycle.sticking_speed, of_cycle.lower, of_cycle.upper
                ),
            }
        of_all = self._sticking.of_all(cycle, stamp_ns)
        if of_all is not None:
            fields |= {
                'mean_sticking_speed': Interval(of_all.sticking_speed, of_all.lower, of_all.upper),
            }
        size = _combined(
            Measured(estimate.cluster_size.value, estimate.cluster_size.error),
            fields.get('weighted_size', UNKNOWN_MEASURED),
        )
        return replace(estimate, combined_size=size, **fields)

    def _of(self, cycle: int, stamp_ns: int) -> StickingEstimate | None:
        """What the cycle says of the sticking speed, as of the last full second."""
        whole_ns = stamp_ns - stamp_ns % _UPDATE_NS
        key = cycle, whole_ns
        if self._of_cycle is None or self._of_cycle[0] != key:
            self._of_cycle = key, self._sticking.of_cycle(cycle, whole_ns)
        return self._of_cycle[1]


def _without_size(estimate: ClusterEstimate) -> ClusterEstimate:
    """The same of a picture whose scale is wrong, of which nobody can tell the size of a bead."""
    return replace(
        estimate,
        size_status=SizeStatus.NOTHING,
        cluster_size=UNKNOWN_MEASURED_INTERVAL,
    )


def _combined(*sizes: Measured) -> Measured:
    """Mean of the known sizes, weighted by their errors."""
    known = [size for size in sizes if size.known]
    if not known:
        return UNKNOWN_MEASURED
    # An error of 0 would be a size that is known exactly; none is.
    weights = [1.0 / max(size.error, _LEAST_ERROR) ** 2 for size in known]
    mean = sum(w * size.value for w, size in zip(weights, known, strict=True)) / sum(weights)
    return Measured(mean, sum(weights) ** -0.5)
