"""The only composition of the stages: a frame in at the top, restitutions out at the bottom."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.experiment.trays import load_trays, tray_by_number
from nanorocks_ros.records import (
    ArrayRecord,
    Autocorrelation,
    BodyEstimate,
    ClusterEstimate,
    CorEstimate,
    Frame,
    Merge,
    MotionMask,
    Notice,
    PairCollision,
    Rebound,
    SpeedEstimate,
    Tracks,
    TrayImage,
)
from nanorocks_ros.stages.clusters.cluster_estimator import ClusterEstimator
from nanorocks_ros.stages.preprocess.preprocessor import Preprocessor
from nanorocks_ros.stages.restitution.restitution_estimator import HaffFitter
from nanorocks_ros.stages.speed.speed_estimator import SpeedEstimator

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.settings import PipelineSettings

Result = TrayImage | MotionMask | Tracks | Autocorrelation | ArrayRecord | Notice


class Wanted(NamedTuple):
    """Which pictures of a tray somebody looks at; they are not made otherwise."""

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
    """The stages behind one tray image.

    Parameters
    ----------
    settings : PipelineSettings
    tray : Tray
    """

    def __init__(self, settings: PipelineSettings, tray: Tray) -> None:
        self.speed = SpeedEstimator(settings, tray)
        self.clusters = ClusterEstimator(settings, tray)
        self.cooling = HaffFitter(settings, tray)

    def emit(self, wanted: Wanted) -> None:
        """Make these pictures from now on."""
        self.speed.emit_mask, self.speed.emit_tracks, self.clusters.emit_image = wanted

    def push(self, image: TrayImage) -> tuple[Result, ...]:
        """Everything that follows from the next image of the tray."""
        records: list[Result] = []
        for record in self.speed.push(image):
            records.append(record)
            if isinstance(record, SpeedEstimate | Rebound | PairCollision | Merge):
                records += self.cooling.push(record)
            if isinstance(record, SpeedEstimate | BodyEstimate | Merge):
                self.clusters.push(record)
        records += self.clusters.push(image)
        return tuple(records)

    def flush(self) -> tuple[CorEstimate | ClusterEstimate, ...]:
        """What was held back when the images ended."""
        return (*self.cooling.flush(), *self.clusters.flush())


class Pipeline:
    """All stages for all trays of the settings.

    Parameters
    ----------
    settings : PipelineSettings
    camera : str
        What to call the source of the frames in an error.
    view : View, optional
        What camera_info says of the lens.

    Raises
    ------
    ConfigurationError
        When the settings cannot be used.
    """

    def __init__(self, settings: PipelineSettings, camera: str, view: View | None = None) -> None:
        settings = calibrated(settings)
        trays = trays_of(settings)
        self.preprocessor = Preprocessor(settings, trays, camera, view)
        self.trays = {number: TrayStages(settings, tray) for number, tray in trays.items()}

    def prepare(self) -> None:
        """Do now what the first frame would have to wait for."""

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
        """The same, of what the preprocessor made of a frame: the rest may be done elsewhere.

        Parameters
        ----------
        records : sequence of TrayImage or Notice
        wanted : mapping of int to Wanted, optional
            By number of the tray; None: as before.
        """
        for number, one in (wanted or {}).items():
            self.trays[number].emit(one)
        found: list[Result] = []
        for record in records:
            found.append(record)
            if isinstance(record, TrayImage):
                found += self.trays[record.tray].push(record)
        return tuple(found)

    def flush(self) -> tuple[CorEstimate | ClusterEstimate, ...]:
        """What was held back when the frames ended: final estimates, and the last of clusters."""
        return tuple(estimate for tray in self.trays.values() for estimate in tray.flush())
