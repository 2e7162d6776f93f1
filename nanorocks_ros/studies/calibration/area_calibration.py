"""Calibration of the speed by the binarised area with manual tracks: one fit for each tray."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.pipeline.tray_measurement import TrayMeasurement
from nanorocks_ros.records import NS, SpeedEstimate, Tracks
from nanorocks_ros.settings import with_values
from nanorocks_ros.stages.tracking.mean_speed import MeanSpeed, mean_speed
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.calibration.area_fit import AreaFit, SpeedPair, fit_area
from nanorocks_ros.studies.calibration.track_comparison import MarkedBeads, manual_reference

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.records import TrayImage
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.manual_tracks import ManualTracks

# Error of a manual position, [px], until the scatter about neighbours in time is known.
_MARK_ERROR_PX = 1.0
# Least path of a bead in half of the window, [px], and the longest window, [ns].
_MIN_PATH_PX = 1.5
_LOOK_BACK_NS = 3 * NS
# Least ratio of a speed to its error.
_MIN_SPEED_OVER_ERROR = 3.0
# Share of saturated windows above which a notice is given.
_MAX_SATURATED_SHARE = 0.2


@dataclass(frozen=True, slots=True)
class _TrayView:
    """Time and displacement of a tray image."""

    stamp_ns: int
    displacement: NDArray[np.float64]
    cycle: int


@dataclass(slots=True, kw_only=True)
class AreaCalibration:
    """Result of a calibration.

    Parameters
    ----------
    fits : dict of int to AreaFit
        Fits by tray.
    refused : dict of int to FitError
        Errors by tray, for trays with too few tracks.
    notices : list of str
    """

    fits: dict[int, AreaFit] = field(default_factory=dict)
    refused: dict[int, FitError] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)


def calibrate_area(
    path: Path,
    manual: ManualTracks,
    settings: PipelineSettings,
    *,
    first_frame: int = 0,
    image_topic: str = '',
    progress: Progress | None = None,
) -> AreaCalibration:
    """Fit the speed by the binarised area to the mean speed of manual tracks.

    Parameters
    ----------
    path : Path
    manual : ManualTracks
        Positions in the frames of the camera.
    settings : PipelineSettings
        With the settings of the binarised area to calibrate.
    first_frame : int
        Number of the first frame in the file of tracks.
    image_topic : str, optional
    progress : callable, optional

    Raises
    ------
    RecordingError
        When the bag cannot be read, or the tracks are not in a tray.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    FitError
        When no tray has enough tracks.
    """
    values = {
        'speed.method': 'binarised_area',
        'speed.area_factor': 1.0,
        'speed.area_offset': 0.0,
    }
    images = BagImages(path, with_values(settings, values, 'calibration'), image_topic)
    estimators = {
        number: TrayMeasurement(images.settings, tray) for number, tray in images.trays.items()
    }
    speeds: dict[int, list[SpeedEstimate]] = {number: [] for number in images.trays}
    pictures: dict[int, list[_TrayView]] = {number: [] for number in images.trays}
    numbers: dict[int, list[int]] = {number: [] for number in images.trays}
    for shot in images.shots(progress):
        for image in shot.images:
            pictures[image.tray].append(_tray_view(image))
            numbers[image.tray].append(shot.number)
            records = estimators[image.tray].push(image)
            speeds[image.tray] += [
                record for record in records if isinstance(record, SpeedEstimate)
            ]
    scale = images.settings.preprocess.pixels_per_metre
    calibration = AreaCalibration(notices=images.notices)
    for number, tray in images.trays.items():
        reference = manual_reference(
            manual,
            pictures[number],
            numbers[number],
            region=images.stage.regions[number],
            pixels_per_metre=scale,
            view=images.view,
            first_frame=first_frame,
        )
        if reference:
            manual_speeds = _manual_speeds(reference, pictures[number], tray, scale)
            _fit(calibration, tray, speeds[number], manual_speeds)
    return _checked(calibration)


def _checked(calibration: AreaCalibration) -> AreaCalibration:
    if not calibration.fits:
        _raise_first(calibration.refused)
        raise RecordingError(
            'the tracks made by hand',
            'lie in no tray and frame of the recording',
            'give places in pixels of its frames, and --first-frame',
        )
    return calibration


def _raise_first(refused: Mapping[int, FitError]) -> None:
    for error in refused.values():
        if len(refused) == 1:
            raise error
        numbers = ', '.join(str(number) for number in refused)
        problem = f'none can be calibrated; of the first, {error.what}'
        raise FitError(f'trays {numbers}', problem, error.do)


def _tray_view(image: TrayImage) -> _TrayView:
    displacement = np.nan_to_num(np.array(image.displacement))
    return _TrayView(image.stamp_ns, displacement, image.cycle or 0)


def _manual_speeds(
    marks: Mapping[int, MarkedBeads], pictures: Sequence[_TrayView], tray: Tray, scale: float
) -> list[MeanSpeed]:
    """Mean speeds of the marked beads, at every image with marks."""
    series: list[Tracks] = []
    speeds = []
    cycle: int | None = None
    for picture in pictures:
        beads = marks.get(picture.stamp_ns)
        if beads is None:
            continue
        if picture.cycle != cycle:
            series, cycle = [], picture.cycle
        series.append(_as_tracks(picture, beads, tray, _MARK_ERROR_PX / scale))
        while picture.stamp_ns - series[0].stamp_ns > _LOOK_BACK_NS:
            series.pop(0)
        speed = mean_speed(series, least_distance=_MIN_PATH_PX / scale)
        if speed is not None and np.isfinite(speed.mean_projected_speed):
            speeds.append(speed)
    return speeds


def _as_tracks(picture: _TrayView, beads: MarkedBeads, tray: Tray, error: float) -> Tracks:
    count = beads.ids.size
    unknown = np.full(count, np.nan)
    return Tracks(
        stamp_ns=picture.stamp_ns,
        tray=tray.number,
        ids=beads.ids.astype(np.int32),
        species=np.zeros(count, dtype=np.int32),
        displacement=picture.displacement,
        positions=beads.positions,
        position_errors=np.full(count, error),
        velocities=np.full((count, 2), np.nan),
        velocity_errors=unknown,
        radii=unknown,
        radius_errors=unknown,
        seen=np.ones(count, dtype=bool),
        # Beads that nobody marked are not lost.
        expected=np.array([count], dtype=np.int32),
    )


def _fit(
    calibration: AreaCalibration,
    tray: Tray,
    speeds: Sequence[SpeedEstimate],
    manual_speeds: Sequence[MeanSpeed],
) -> None:
    where = f'tray {tray.number}'
    pairs, saturated = _pairs(speeds, manual_speeds)
    if saturated > _MAX_SATURATED_SHARE * (saturated + len(pairs)):
        calibration.notices.append(
            f'{where}: in {saturated} of {saturated + len(pairs)} windows the area is saturated '
            'and gives no speed; calibrate speed.geometry taylor, or fewer speed.averaged_frames'
        )
    try:
        calibration.fits[tray.number] = fit_area(pairs, tray.count, where)
    except FitError as error:
        calibration.refused[tray.number] = error


def _pairs(
    speeds: Sequence[SpeedEstimate], manual_speeds: Sequence[MeanSpeed]
) -> tuple[list[SpeedPair], int]:
    """Speed pairs of windows that do not overlap, and the number of saturated windows."""
    middles = np.array([speed.stamp_ns for speed in manual_speeds], dtype=np.int64)
    pairs: list[SpeedPair] = []
    saturated = 0
    last_end = -np.inf
    for speed in speeds if manual_speeds else ():
        nearest = manual_speeds[int(np.abs(middles - speed.stamp_ns).argmin())]
        half = 0.5 * max(speed.window, nearest.window) * NS
        # The speed of beads at rest would be the error of the manual positions.
        moving = (
            nearest.mean_projected_speed
            > _MIN_SPEED_OVER_ERROR * nearest.mean_projected_speed_error
        )
        overlapping = abs(nearest.stamp_ns - speed.stamp_ns) <= half
        if not (moving and overlapping) or speed.stamp_ns - half < last_end:
            continue
        last_end = speed.stamp_ns + half
        if not np.isfinite(speed.mean_projected_speed.value):
            saturated += 1
            continue
        pairs.append(
            SpeedPair(
                stamp_ns=speed.stamp_ns,
                area_speed=speed.mean_projected_speed.value,
                area_speed_error=speed.mean_projected_speed.error,
                manual_speed=nearest.mean_projected_speed,
                manual_speed_error=nearest.mean_projected_speed_error,
                beads=nearest.beads,
            )
        )
    return pairs, saturated
