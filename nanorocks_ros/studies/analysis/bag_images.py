"""The tray images of a bag: its frames, preprocessed.

Tested by ``test/studies/inspection/test_preprocessing_steps.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.experiment.calibration_file import calibrated
from nanorocks_ros.pipeline.composition import trays_of
from nanorocks_ros.records import Frame, Notice, TrayImage
from nanorocks_ros.stages.preprocess.preprocessor import Preprocessor
from nanorocks_ros.studies.analysis.bag_frames import BagFrames

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from nanorocks_ros.settings import PipelineSettings


class Shot(NamedTuple):
    """A frame of a bag and what the preprocessor made of it.

    Parameters
    ----------
    number : int
        Of the frame, counted from 0.
    frame : Frame
    images : tuple of TrayImage
        Of the trays that can be used; may be empty.
    """

    number: int
    frame: Frame
    images: tuple[TrayImage, ...]


class BagImages:
    """Preprocesses the frames of a bag.

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
    frames : int
        Frames read so far, whether they could be used or not.
    refused : FrameError or None
        Why the first of the frames that could not be used could not.

    Raises
    ------
    RecordingError
        When the bag cannot be read or holds no camera.
    ConfigurationError
        When the settings cannot be used.
    """

    def __init__(self, path: Path, settings: PipelineSettings, image_topic: str = '') -> None:
        self.bag = BagFrames(path, image_topic)
        epoch_ns = self.bag.epoch_ns()
        if epoch_ns is None:
            raise RecordingError(
                self.bag.where, 'holds no frame', 'pass another bag or --image-topic'
            )
        self.epoch_ns = epoch_ns
        self.settings = calibrated(settings)
        self.trays = trays_of(self.settings)
        self.stage = Preprocessor(self.settings, self.trays, self.bag.where, self.bag.view())
        self.view = self.stage.view
        self.frames = 0
        self.refused: FrameError | None = None
        self._notices: list[str] = []
        self._any = False

    @property
    def notices(self) -> list[str]:
        """Notices for the user, complete once the frames have been read."""
        notices = [*self.bag.reader.notices, *self._notices]
        if self.refused is not None:
            notices.append(str(self.refused))
        if self.view is None:
            notices.append(
                f'{self.bag.where}: no camera_info and no calibration file; the picture is taken '
                'as straight'
            )
        return notices

    def shots(self, progress: Callable[[int, int], None] | None = None) -> Iterator[Shot]:
        """Every frame that can be decoded, in order; once.

        Parameters
        ----------
        progress : callable, optional
            Called with the frames done and the frames there are.

        Raises
        ------
        FrameError
            At the end, when no frame could be used.
        """
        for number, frame in enumerate(self.bag.frames()):
            self.frames = number + 1
            try:
                if isinstance(frame, FrameError):
                    raise frame
                records = self.stage.push(frame)
            except FrameError as error:
                self.refused = self.refused or error
            else:
                self._notices += [record.text for record in records if isinstance(record, Notice)]
                images = tuple(record for record in records if isinstance(record, TrayImage))
                self._any = self._any or bool(images)
                yield Shot(number, frame, images)
            if progress is not None:
                progress(number + 1, self.bag.count)
        if not self._any:
            raise self.refused or FrameError(
                self.bag.where,
                'no frame can be used: all are black, white or broken',
                'record it again',
            )
