"""From a bag to its frames and tray images.

Tested by ``test/studies/inspection/test_preprocessing_steps.py``.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import Frame, Notice, TrayImage
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from nanorocks_ros.experiment.view import View
    from nanorocks_ros.settings import PipelineSettings


class BagCamera(NamedTuple):
    """The camera of a bag.

    Parameters
    ----------
    bag : BagFrames
    epoch_ns : int
        What times count from.
    view : View or None
        What the bag says of the lens; None when it says nothing, or the settings name a
        calibration file, which replaces it.
    """

    bag: BagFrames
    epoch_ns: int
    view: View | None


class Shot(NamedTuple):
    """A frame of a bag and what the preprocessor made of it.

    Parameters
    ----------
    number : int
        Of the frame, counted from 0.
    frame : Frame
    records : tuple of TrayImage and Notice
    """

    number: int
    frame: Frame
    records: tuple[TrayImage | Notice, ...]

    @property
    def images(self) -> tuple[TrayImage, ...]:
        """Images of the trays that can be used; may be empty."""
        return tuple(record for record in self.records if isinstance(record, TrayImage))


class _WaitingFrame(NamedTuple):
    """A frame, and the records of it so far; see `Shot`."""

    number: int
    frame: Frame
    records: list[TrayImage | Notice]


def open_camera(path: str | Path, settings: PipelineSettings, image_topic: str = '') -> BagCamera:
    """Open a bag and read what is known of its camera.

    Parameters
    ----------
    path : str or Path
    settings : PipelineSettings
    image_topic : str, optional
        The camera's topic if it has another name than the graph's.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    """
    bag = BagFrames(path, image_topic)
    epoch_ns = bag.epoch_ns()
    if epoch_ns is None:
        raise RecordingError(bag.where, 'holds no frame', 'pass another bag or --image-topic')
    return BagCamera(bag, epoch_ns, None if settings.preprocess.calibration else bag.view())


class PreprocessedFrames:
    """The frames of a bag, pushed through a preprocessor.

    Parameters
    ----------
    bag : BagFrames
    stage : Preprocessor

    Attributes
    ----------
    frames : int
        Frames read so far, whether they could be used or not.
    refused : int
        Frames that could not be used so far.
    error : FrameError or None
        Why the first of them could not.
    """

    def __init__(self, bag: BagFrames, stage: Preprocessor) -> None:
        self._bag = bag
        self._stage = stage
        self.frames = 0
        self.refused = 0
        self.error: FrameError | None = None
        self._waiting: deque[_WaitingFrame] = deque()

    @property
    def lens_notices(self) -> list[str]:
        """A notice for the user when the lens is unknown."""
        if self._stage.view is not None:
            return []
        return [
            f'{self._bag.where}: neither camera_info nor a calibration file; the lens is taken as '
            'free of distortion'
        ]

    def shots(
        self, progress: Callable[[int, int], None] | None = None, *, every: int = 1
    ) -> Iterator[Shot]:
        """Every frame that can be decoded, in order; once.

        Parameters
        ----------
        progress : callable, optional
            Called with the frames done and the frames there are.
        every : int, optional
            1: each frame; 2: every other one, and so on.

        Raises
        ------
        FrameError
            At the end, when no frame could be used.
        """
        any_images = False
        for number, frame in enumerate(self._bag.frames()):
            self.frames = number + 1
            if number % every == 0:
                self._take(number, frame)
            for shot in self._complete(self._stage.held_from_ns):
                any_images = any_images or bool(shot.images)
                yield shot
            if progress is not None:
                progress(number + 1, self._bag.count)
        self._hand_out(self._stage.flush())
        for shot in self._complete(math.inf):
            any_images = any_images or bool(shot.images)
            yield shot
        if not any_images:
            raise self.error or FrameError(
                self._bag.where,
                'no frame can be used: all are black, white or broken',
                'record it again',
            )

    def _take(self, number: int, frame: Frame | FrameError) -> None:
        """Preprocess the next frame, unless it is refused."""
        try:
            if isinstance(frame, FrameError):
                raise frame
            records = self._stage.push(frame)
        except FrameError as error:
            self.refused += 1
            self.error = self.error or error
            return
        self._waiting.append(_WaitingFrame(number, frame, []))
        self._hand_out(records)

    def _hand_out(self, records: Sequence[TrayImage | Notice]) -> None:
        """Give each image to its frame, and each notice to the last frame."""
        for record in records:
            own = [
                waiting
                for waiting in self._waiting
                if isinstance(record, TrayImage) and waiting.frame.stamp_ns == record.stamp_ns
            ]
            (own or self._waiting)[-1].records.append(record)

    def _complete(self, held_from_ns: float) -> Iterator[Shot]:
        """The frames whose images the preprocessor does not hold back any more."""
        while self._waiting and self._waiting[0].frame.stamp_ns < held_from_ns:
            number, frame, records = self._waiting.popleft()
            yield Shot(number, frame, tuple(records))


class BagImages:
    """The tray images of a bag, for a study without the whole pipeline.

    Parameters
    ----------
    path : Path
    settings : PipelineSettings
    image_topic : str, optional
        The camera's topic if it has another name than the graph's.

    Attributes
    ----------
    bag : BagFrames
    epoch_ns : int
        What times count from.
    settings : PipelineSettings
        With what the calibration file says.
    trays : dict of int to Tray
    view : View or None
        What is known of the lens.
    stage : Preprocessor

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    ConfigurationError
        When the settings cannot be used.
    """

    def __init__(self, path: Path, settings: PipelineSettings, image_topic: str = '') -> None:
        self.bag, self.epoch_ns, view = open_camera(path, settings, image_topic)
        self.settings = calibrated(settings)
        self.trays = trays_of(self.settings)
        self.stage = Preprocessor(self.settings, self.trays, self.bag.where, view)
        self.view = self.stage.view
        self._frames = PreprocessedFrames(self.bag, self.stage)
        self._notices: list[str] = []

    @property
    def frames(self) -> int:
        """Frames read so far, whether they could be used or not."""
        return self._frames.frames

    @property
    def error(self) -> FrameError | None:
        """Why the first of the frames that could not be used could not."""
        return self._frames.error

    @property
    def notices(self) -> list[str]:
        """Notices for the user, complete once the frames have been read."""
        refusal = [] if self.error is None else [str(self.error)]
        return [
            *self.bag.reader.notices,
            *self._notices,
            *refusal,
            *self._frames.lens_notices,
        ]

    def shots(
        self, progress: Callable[[int, int], None] | None = None, *, every: int = 1
    ) -> Iterator[Shot]:
        """Every frame that can be decoded; see `PreprocessedFrames.shots`."""
        for shot in self._frames.shots(progress, every=every):
            self._notices += [record.text for record in shot.records if isinstance(record, Notice)]
            yield shot
