"""From the recording of a film to all that it says: tracks, speeds, contacts, decay, a report.

Every step leaves files in the folder of results. A second run takes what it needs from them.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from nanorocks_ros.errors import NanorocksError, RecordingError
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.outputs.atomic_files import write_bytes
from nanorocks_ros.outputs.json_values import read_object
from nanorocks_ros.pipeline.contact_words import contact_lines, length_unit, motion_line
from nanorocks_ros.recordings.bag.find_bags import RESULTS_MARK
from nanorocks_ros.stages.clusters.correlation_width import SIZES_UNKNOWN
from nanorocks_ros.stages.contact_restitution.track_contacts import track_contacts
from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag, track_bag
from nanorocks_ros.studies.analysis.results.tracks_files import write_tracks
from nanorocks_ros.studies.analysis.results.tray_words import tray_lines
from nanorocks_ros.studies.inspection.track_overlay import overlay, with_scale_bar, write_overlay
from nanorocks_ros.studies.measure.film_decay import DecayStep, measured_decay
from nanorocks_ros.studies.measure.measure_report import write_measure_report
from nanorocks_ros.studies.measure.measured_folder import TRACKS, prepare_folder, write_measured
from nanorocks_ros.studies.measure.measured_tray import DECAY_NOT_READ, DECAY_PREFIX, MeasuredTray
from nanorocks_ros.studies.measure.track_archive import save_tracks, saved_tracks, tracking_key
from nanorocks_ros.studies.measure.track_speeds import track_speeds

if TYPE_CHECKING:
    from collections.abc import Callable
    from contextlib import AbstractContextManager
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from nanorocks_ros.jobs.progress import Progress
    from nanorocks_ros.jobs.tasks import Workers
    from nanorocks_ros.settings import PipelineSettings

_TRACKS, _PICTURE = 'tracks.npz', 'tracks.png'
_MAGNIFICATION = 2


class Teller(Protocol):
    """Whoever tells the user how far the work is."""

    def say(self, line: str) -> None:
        """Tell a result or a reason."""

    def progress(self, label: str) -> AbstractContextManager[Progress]:
        """Show how far a step is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasurePlan:
    """What to measure.

    Parameters
    ----------
    bag : Path
        Recording of the film.
    name : str
        Of the film, for the report.
    folder : Path
        For the results.
    settings : PipelineSettings
    image_topic : str
    workers : Workers
        For the library of decays.
    name_files : callable
        Gives a text whose commands name the recording as the user did.
    """

    bag: Path
    name: str
    folder: Path
    settings: PipelineSettings
    image_topic: str
    workers: Workers
    name_files: Callable[[str], str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What was measured.

    Parameters
    ----------
    trays : tuple of MeasuredTray
    usable : bool
        Whether the beads were recognised well enough.
    report : Path
    tracked : TrackedBag
        The tracks; without pictures where they are those of an earlier run.
    """

    trays: tuple[MeasuredTray, ...]
    usable: bool
    report: Path
    tracked: TrackedBag


def measure_film(plan: MeasurePlan, teller: Teller) -> Measured:
    """Measure a film, step by step.

    Raises
    ------
    RecordingError
        When the recording cannot be read, or the results not be written.
    ConfigurationError
        When the settings cannot be used.
    FrameError
        When no frame can be used.
    """
    prepare_folder(plan.folder)
    tracked = _tracked(plan, teller)
    trays = tuple(_measured_tray(plan, tracked, number, teller) for number in tracked.trays)
    report = plan.folder / 'report.html'
    write_measured(plan.folder, plan.name, tracked, trays, plan.settings)
    write_measure_report(report, plan.name, tracked, trays, plan.folder / _PICTURE)
    return Measured(trays=trays, usable=tracked.usable, report=report, tracked=tracked)


def _tracked(plan: MeasurePlan, teller: Teller) -> TrackedBag:
    """The tracks, by this run or by an earlier one."""
    key = tracking_key(plan.bag, plan.settings, plan.image_topic)
    archive = plan.folder / _TRACKS
    tracked = saved_tracks(archive, plan.settings, key)
    if tracked is not None and (plan.folder / _PICTURE).exists():
        teller.say(f'tracks: those of an earlier run, {archive}')
        return tracked
    with teller.progress('tracking') as progress:
        tracked = track_bag(
            plan.bag, plan.settings, image_topic=plan.image_topic, progress=progress
        )
    tracked = replace(tracked, notices=[plan.name_files(notice) for notice in tracked.notices])
    for notice in tracked.notices:
        teller.say(notice)
    write_tracks(plan.folder / TRACKS, tracked, described=False)
    write_overlay(plan.folder / _PICTURE, _pictures(plan, tracked))
    save_tracks(archive, tracked, key)
    return tracked


def _pictures(plan: MeasurePlan, tracked: TrackedBag) -> list[NDArray[np.uint8]]:
    """The last frame of each tray with its tracks, and a scale bar where a length is known."""
    scale = tracked.pixels_per_metre
    pictures = [
        overlay(image, tracked.tracks[number], scale, magnification=_MAGNIFICATION)
        for number, image in sorted(tracked.pictures.items())
    ]
    if length_unit(film_section(plan.settings.trays_file)).name == 'px':
        return pictures
    return [with_scale_bar(picture, _MAGNIFICATION * scale) for picture in pictures]


def _measured_tray(
    plan: MeasurePlan, tracked: TrackedBag, number: int, teller: Teller
) -> MeasuredTray:
    """Everything of one tray."""
    tray, records = tracked.trays[number], tracked.tracks[number]
    film = film_section(plan.settings.trays_file)
    height_known = not math.isnan(tray.dimensions[2])
    known = height_known and (film is None or film.container_known)
    unit = length_unit(film_section(plan.settings.trays_file))
    recognition = [
        plan.name_files(line) for verdict in tracked.verdicts[number] for line in verdict.lines()
    ]
    for line in recognition:
        teller.say(line)
    speeds = track_speeds(records)
    with teller.progress('contacts') as progress:
        contacts = track_contacts(
            records, tray, plan.settings, container_known=known, progress=progress
        )
    motion = motion_line(speeds.ends, contacts, unit, speeds.highest)
    lines = [motion, *contact_lines(contacts, unit)]
    for line in lines:
        teller.say(line)
    step = DecayStep(
        tray=tray,
        records=records,
        container_known=known,
        verdicts=tracked.verdicts[number],
    )
    decay_lines = [
        line
        for line in map(plan.name_files, _decay_lines(plan, step, teller))
        if line.removeprefix(DECAY_PREFIX) not in tracked.notices
    ]
    for line in decay_lines:
        teller.say(line)
    return MeasuredTray(
        number=number,
        unit=unit,
        speeds=speeds,
        contacts=contacts,
        recognition=tuple(recognition),
        lines=tuple(lines),
        decay=tuple(decay_lines),
    )


def _decay_lines(plan: MeasurePlan, step: DecayStep, teller: Teller) -> list[str]:
    """What the decay of the speeds says, or why it is not read."""
    reason = step.reason_against
    if reason:
        return [f'{DECAY_NOT_READ}; {reason}{_of_an_earlier_call(plan, step.tray.number)}']
    number = step.tray.number
    key = tracking_key(plan.bag, plan.settings, plan.image_topic)
    note = plan.folder / f'tray_{number}_decay.json'
    known = _noted(note)
    if known.get('key') == key and isinstance(lines := known.get('lines'), list):
        return [str(line) for line in lines]
    settings = replace(plan.settings, trays=(number,))
    try:
        analysis = measured_decay(plan, replace(step, settings=settings), teller)
    except RecordingError:
        raise
    except NanorocksError as error:
        return [f'{DECAY_NOT_READ}; {error}']
    said = {line for verdict in step.verdicts for line in verdict.lines()}
    # Of sizes of clusters nothing is told here.
    notices = [notice for notice in analysis.notices if SIZES_UNKNOWN not in notice]
    lines = [
        f'{DECAY_PREFIX}{line.strip()}'
        for line in (*notices, *tray_lines(analysis, analysis.trays[number]))
        if line.strip() not in said
    ]
    write_bytes(note, json.dumps({'key': key, 'lines': lines}).encode())
    return lines


def _of_an_earlier_call(plan: MeasurePlan, number: int) -> str:
    """What is said of results of the decay that an earlier call left."""
    folder = plan.folder / f'tray_{number}'
    if not (folder / RESULTS_MARK).is_file():
        return ''
    return f'; {folder} is of an earlier call, which was given more'


def _noted(note: Path) -> dict[str, Any]:
    try:
        return read_object(note)
    except (OSError, ValueError, RecordingError):
        return {}
