"""The only composition of the stages: from a frame to the coefficients of restitution.

Tested by ``test/pipeline/test_parallel_pipeline.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.experiment.trays import (
    load_trays,
    require_measurable,
    tray_by_number,
)
from nanorocks_ros.pipeline.changed_settings import Part
from nanorocks_ros.pipeline.open_trays import OpenMeasurement, reason_for_contacts
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement, TrayRecord
from nanorocks_ros.records import (
    ArrayRecord,
    Autocorrelation,
    BodyEstimate,
    CorEstimate,
    Frame,
    Merge,
    MotionMask,
    Notice,
    PairCollision,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator
from nanorocks_ros.stages.contact_restitution.contact_estimator import (
    ContactEstimator,
    ContactInput,
)
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.restitution.restitution_estimator import (
    RestitutionEstimator,
    RestitutionInput,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.settings import PipelineSettings

Result = TrayImage | MotionMask | Tracks | Autocorrelation | ArrayRecord | Notice


class Wanted(NamedTuple):
    """The pictures of a tray that have a viewer; others are not made."""

    mask: bool = False
    tracks: bool = False
    autocorrelation: bool = False


def trays_of(settings: PipelineSettings) -> dict[int, Tray]:
    """The trays that the settings name, by number.

    Raises
    ------
    ConfigurationError
        When the file cannot be used or a tray does not exist.
    """
    flown = load_trays(settings.trays_file)
    return {number: tray_by_number(flown, number) for number in settings.trays}


class TrayStages:
    """The stages behind the images of one tray.

    An image goes to the measurement of tracks, contacts, bodies and speeds; from these the
    restitution and, with the image itself, the clusters are estimated.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self._tray = tray
        self._last_ns: int | None = None
        self.measurement = TrayMeasurement(settings, tray)
        self.restitution = RestitutionEstimator(settings, tray)
        self.clusters = ClusterEstimator(settings, tray)

    @classmethod
    def of(cls, settings: PipelineSettings, tray: Tray) -> TrayStages | OpenTrayStages:
        """The stages of a tray, whatever is known of it."""
        if reason_for_contacts(settings, tray):
            return OpenTrayStages(settings, tray)
        return cls(settings, tray)

    def adopt(self, settings: PipelineSettings, parts: Part) -> None:
        """Take other settings of clusters and restitution; the measurement goes on.

        Parameters
        ----------
        settings : PipelineSettings
        parts : Part
            That the change concerns.
        """
        if Part.RESTITUTION in parts:
            self.restitution.adopt(settings)
        if Part.CLUSTERS in parts:
            self.clusters = ClusterEstimator(settings, self._tray)

    def emit(self, wanted: Wanted) -> None:
        """Choose the pictures to make from now on."""
        self.measurement.emit_mask = wanted.mask
        self.measurement.emit_tracks = wanted.tracks
        self.clusters.emit_image = wanted.autocorrelation

    def push(self, image: TrayImage) -> tuple[Result, ...]:
        """Everything that follows from the next image of the tray.

        Where its stamp goes back, what is held back of the images before comes first.
        """
        before: tuple[Result, ...] = ()
        if self._last_ns is not None and image.stamp_ns <= self._last_ns:
            before = self.flush()
            for stage in (self.measurement, self.restitution, self.clusters):
                stage.reset()
        self._last_ns = image.stamp_ns
        return (*before, *self._follow(image))

    def _follow(self, image: TrayImage) -> tuple[Result, ...]:
        return (*self._estimates(self.measurement.push(image)), *self.clusters.push(image))

    def flush(self) -> tuple[Result, ...]:
        """Everything that is held back when the images end.

        Contacts first: they are part of the final restitution, as bodies are of the clusters.
        """
        measured = self._estimates(self.measurement.flush())
        # The scale may have been found wrong after the last speed.
        self.restitution.flag_cycle(self.measurement.scale_flag)
        return (
            *measured,
            *self.restitution.flush(),
            *self.clusters.flush(),
        )

    def _estimates(self, measured: Iterable[TrayRecord]) -> list[TrayRecord | CorEstimate]:
        """The records measured, each with the estimates that follow from it."""
        records: list[TrayRecord | CorEstimate] = []
        for record in measured:
            records.append(record)
            if isinstance(record, RestitutionInput):
                records += self.restitution.push(record)
            if isinstance(record, SpeedEstimate | BodyEstimate | Merge | PairCollision):
                self.clusters.push(record)
        return records


class OpenTrayStages:
    """The stages behind the images of a tray of which only contacts are measured.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        reason = reason_for_contacts(settings, tray)
        self.measurement = OpenMeasurement(settings, tray, reason)
        self.restitution = ContactEstimator(settings, tray)

    def adopt(self, settings: PipelineSettings, parts: Part) -> None:
        """See `TrayStages.adopt`."""
        if Part.RESTITUTION in parts:
            self.restitution.adopt(settings)

    def emit(self, wanted: Wanted) -> None:
        """Choose the pictures to make from now on."""
        self.measurement.emit_tracks = wanted.tracks

    def push(self, image: TrayImage) -> tuple[Result, ...]:
        """Everything that follows from the next image of the tray."""
        return tuple(self._estimates(self.measurement.push(image)))

    def flush(self) -> tuple[Result, ...]:
        """Everything that is held back when the images end."""
        return (*self._estimates(self.measurement.flush()), *self.restitution.flush())

    def _estimates(self, measured: Iterable[Result]) -> list[Result]:
        """The records measured, each with the estimate that follows from it."""
        results: list[Result] = []
        for record in measured:
            results.append(record)
            if isinstance(record, ContactInput):
                results += self.restitution.push(record)
        return results


class Pipeline:
    """All stages for all trays of the settings.

    Parameters
    ----------
    settings : PipelineSettings
    camera : str
        Name of the source of the frames in errors.
    view : View, optional
        The lens, from camera_info.
    contacts_suffice : bool
        Whether only contacts are measured of a tray whose decay cannot be read; else such a tray
        is refused.

    Raises
    ------
    ConfigurationError
        When the settings cannot be used.
    """

    def __init__(
        self,
        settings: PipelineSettings,
        camera: str,
        view: View | None = None,
        *,
        contacts_suffice: bool = False,
    ) -> None:
        settings = calibrated(settings)
        trays = trays_of(settings)
        if not contacts_suffice:
            for tray in trays.values():
                require_measurable(tray)
        self.preprocessor = Preprocessor(settings, trays, camera, view)
        make = TrayStages.of if contacts_suffice else TrayStages
        self.trays = {number: make(settings, tray) for number, tray in trays.items()}

    @property
    def cooling_trays(self) -> dict[int, TrayStages]:
        """The stages of the trays whose decay is read."""
        return {
            number: stages
            for number, stages in self.trays.items()
            if isinstance(stages, TrayStages)
        }

    def prepare(self) -> None:
        """Prepare for the first frame, so that it need not wait."""

    def adopt(self, settings: PipelineSettings, parts: Part) -> None:
        """See `TrayStages.adopt`; for changes of other parts make a new pipeline."""
        for tray in self.trays.values():
            tray.adopt(calibrated(settings), parts)

    def push(self, frame: Frame) -> tuple[Result, ...]:
        """Everything that follows from the next frame, tray images first.

        Raises
        ------
        FrameError
            For an encoding that is not supported or a size that changed.
        """
        return self.follow(self.preprocessor.push(frame))

    def follow(
        self, records: Sequence[TrayImage | Notice], wanted: Mapping[int, Wanted] | None = None
    ) -> tuple[Result, ...]:
        """Everything that follows from the records of the preprocessor, these included.

        Parameters
        ----------
        records : sequence of TrayImage or Notice
        wanted : mapping of int to Wanted, optional
            By number of the tray; None: as before.
        """
        for number, pictures in (wanted or {}).items():
            self.trays[number].emit(pictures)
        results: list[Result] = []
        for record in records:
            results.append(record)
            if isinstance(record, TrayImage):
                results += self.trays[record.tray].push(record)
        return tuple(results)

    def flush(self) -> tuple[Result, ...]:
        """Everything that is held back when the frames end."""
        last = self.follow(self.preprocessor.flush())
        return (*last, *(estimate for tray in self.trays.values() for estimate in tray.flush()))
