"""Calibration of the binarised area: a bag and tracks made by hand in, a fit per tray out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from nanorocks_ros.errors import FitError, RecordingError
from nanorocks_ros.records import SpeedEstimate, Tracks
from nanorocks_ros.settings import with_values
from nanorocks_ros.stages.speed.speed_estimator import SpeedEstimator
from nanorocks_ros.stages.tracking.mean_speed import MeanSpeed, mean_speed
from nanorocks_ros.studies.analysis.bag_images import BagImages
from nanorocks_ros.studies.calibration.area_fit import AreaFit, SpeedPair, fit_area
from nanorocks_ros.studies.calibration.track_comparison import Place, manual_reference
from nanorocks_ros.wire.array_layouts import NS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.records import TrayImage
    from nanorocks_ros.settings import PipelineSettings
    from nanorocks_ros.studies.calibration.manual_tracks import ManualTracks

# What a hand misses a bead by, [px]; how far a place lies off its neighbours in time tells more.
_MARK_ERROR_PX = 1.0
# A bead should come so many pixels in half of the window, and is looked back upon for so long.
_LEAST_PATH_PX = 1.5
_LOOK_BACK_NS = 3 * NS
# A speed below so many of its errors is none.
_MOVING = 3.0
# Share of windows without a speed by the area of which the user hears.
_MOST_FULL = 0.2


@dataclass(frozen=True, slots=True)
class _Picture:
    """When a picture of a tray was taken, and where the tray was."""

    stamp_ns: int
    displacement: NDArray[np.float64]
    cycle: int


@dataclass(slots=True, kw_only=True)
class AreaCalibration:
    """What the tracks say of the binarised area.

    Parameters
    ----------
    fits : dict of int to AreaFit
        By tray.
    refused : dict of int to FitError
        Trays with tracks that do not suffice.
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
    progress: Callable[[int, int], None] | None = None,
) -> AreaCalibration:
    """Fit the speed by the binarised area to the mean speed of tracks made by hand.

    Parameters
    ----------
    path : Path
    manual : ManualTracks
        Places in the frames as the camera gave them.
    settings : PipelineSettings
        With the reading of the binarised area to calibrate.
    first_frame : int
        Number that the tracks give to the first frame.
    image_topic : str, optional
    progress : callable, optional

    Raises
    ------
    RecordingError
        When the bag cannot be read, or the tracks lie in no tray of it.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    FitError
        When the tracks of no tray suffice.
    """
    values = {
        'speed.method': 'binarised_area',
        'speed.area_factor': 1.0,
        'speed.area_offset': 0.0,
    }
    images = BagImages(path, with_values(settings, values, 'calibration'), image_topic)
    estimators = {
        number: SpeedEstimator(images.settings, tray) for number, tray in images.trays.items()
    }
    speeds: dict[int, list[SpeedEstimate]] = {number: [] for number in images.trays}
    pictures: dict[int, list[_Picture]] = {number: [] for number in images.trays}
    numbers: dict[int, list[int]] = {number: [] for number in images.trays}
    for shot in images.shots(progress):
        for image in shot.images:
            pictures[image.tray].append(_picture(image))
            numbers[image.tray].append(shot.number)
            records = estimators[image.tray].push(image)
            speeds[image.tray] += [
                record for record in records if isinstance(record, SpeedEstimate)
            ]
    scale = images.settings.preprocess.pixels_per_metre
    calibration = AreaCalibration(notices=images.notices)
    for number, tray in images.trays.items():
        marks = manual_reference(
            manual,
            pictures[number],
            numbers[number],
            region=images.stage.regions[number],
            pixels_per_metre=scale,
            view=images.view,
            first_frame=first_frame,
        )
        if marks:
            by_hand = _manual_speeds(marks, pictures[number], tray, scale)
            _fit(calibration, tray, speeds[number], by_hand)
    return _checked(calibration)


def _checked(found: AreaCalibration) -> AreaCalibration:
    if not found.fits:
        _raise_first(found.refused)
        raise RecordingError(
            'the tracks made by hand',
            'lie in no tray and frame of the recording',
            'give places in pixels of its frames, and --first-frame',
        )
    return found


def _raise_first(refused: Mapping[int, FitError]) -> None:
    for error in refused.values():
        if len(refused) == 1:
            raise error
        numbers = ', '.join(str(number) for number in refused)
        what = f'none can be calibrated; of the first, {error.what}'
        raise FitError(f'trays {numbers}', what, error.do)


def _picture(image: TrayImage) -> _Picture:
    displacement = np.nan_to_num(np.array(image.displacement))
    return _Picture(image.stamp_ns, displacement, image.cycle or 0)


def _manual_speeds(
    marks: Mapping[int, Place], pictures: Sequence[_Picture], tray: Tray, scale: float
) -> list[MeanSpeed]:
    """Mean speeds of the beads that were marked, at every picture with marks."""
    series: list[Tracks] = []
    found = []
    cycle: int | None = None
    for picture in pictures:
        place = marks.get(picture.stamp_ns)
        if place is None:
            continue
        if picture.cycle != cycle:
            series, cycle = [], picture.cycle
        series.append(_as_tracks(picture, place, tray, _MARK_ERROR_PX / scale))
        while picture.stamp_ns - series[0].stamp_ns > _LOOK_BACK_NS:
            series.pop(0)
        one = mean_speed(series, least_distance=_LEAST_PATH_PX / scale)
        if one is not None and np.isfinite(one.mean_projected_speed):
            found.append(one)
    return found


def _as_tracks(picture: _Picture, place: Place, tray: Tray, error: float) -> Tracks:
    count = place.ids.size
    unknown = np.full(count, np.nan)
    return Tracks(
        stamp_ns=picture.stamp_ns,
        tray=tray.number,
        ids=place.ids.astype(np.int32),
        species=np.zeros(count, dtype=np.int32),
        displacement=picture.displacement,
        positions=place.positions,
        position_errors=np.full(count, error),
        velocities=np.full((count, 2), np.nan),
        velocity_errors=unknown,
        radii=unknown,
        radius_errors=unknown,
        seen=np.ones(count, dtype=bool),
        expected=np.array([tray.count], dtype=np.int32),
    )


def _fit(
    found: AreaCalibration,
    tray: Tray,
    speeds: Sequence[SpeedEstimate],
    by_hand: Sequence[MeanSpeed],
) -> None:
    where = f'tray {tray.number}'
    pairs, full = _pairs(speeds, by_hand)
    if full > _MOST_FULL * (full + len(pairs)):
        found.notices.append(
            f'{where}: in {full} of {full + len(pairs)} windows the area is as large as it gets '
            'and says nothing; calibrate speed.geometry taylor, or fewer speed.averaged_frames'
        )
    try:
        found.fits[tray.number] = fit_area(pairs, tray.count, where)
    except FitError as error:
        found.refused[tray.number] = error


def _pairs(
    speeds: Sequence[SpeedEstimate], by_hand: Sequence[MeanSpeed]
) -> tuple[list[SpeedPair], int]:
    """Windows that do not overlap, each with the manual speed at its middle.

    And how many more there were in which the area says nothing.
    """
    middles = np.array([one.stamp_ns for one in by_hand], dtype=np.int64)
    pairs: list[SpeedPair] = []
    full = 0
    last_end = -np.inf
    for speed in speeds if by_hand else ():
        near = by_hand[int(np.abs(middles - speed.stamp_ns).argmin())]
        half = 0.5 * max(speed.window, near.window) * NS
        # Beads at rest tell the jitter of the hand, not a speed.
        moving = near.mean_projected_speed > _MOVING * near.mean_projected_speed_error
        beside = abs(near.stamp_ns - speed.stamp_ns) <= half
        if not (moving and beside) or speed.stamp_ns - half < last_end:
            continue
        last_end = speed.stamp_ns + half
        if not np.isfinite(speed.mean_projected_speed.value):
            full += 1
            continue
        pairs.append(
            SpeedPair(
                stamp_ns=speed.stamp_ns,
                area_speed=speed.mean_projected_speed.value,
                area_speed_error=speed.mean_projected_speed.error,
                manual_speed=near.mean_projected_speed,
                manual_speed_error=near.mean_projected_speed_error,
                beads=near.beads,
            )
        )
    return pairs, full
