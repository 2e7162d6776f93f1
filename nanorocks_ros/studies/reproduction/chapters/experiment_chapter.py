"""Chapters on the experiment and its processing: Tables 1 and 2, Figures 1, 3 and 4.

Tested by ``test/studies/reproduction/test_reproduce_paper.py``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np

from nanorocks_ros.errors import FrameError, RecordingError
from nanorocks_ros.experiment.paper_values import PAPER_TRACKED
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.outputs.atomic_files import atomic_file
from nanorocks_ros.outputs.html_report import NOT_KNOWN, Picture, Section, Table
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.analysis.bag_tracks import track_bag
from nanorocks_ros.studies.inspection.preprocessing_steps import steps_of_bag
from nanorocks_ros.studies.inspection.steps_figure import steps_figure
from nanorocks_ros.studies.inspection.track_overlay import (
    MAGNIFICATION,
    overlay,
    with_scale_bar,
    write_overlay,
)
from nanorocks_ros.studies.reproduction.campaign_plan import STICKING, plate_settings
from nanorocks_ros.studies.reproduction.chapters.chapter_context import Chapter, Difference

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from nanorocks_ros.experiment.trays import Tray
    from nanorocks_ros.studies.reproduction.chapters.chapter_context import Context

_WIDTH = 1100
_FRAME = 60
# Time of the frame shown, soon after the shaking event, when many beads move, [s].
_STEPS_AT = 2.5
# Shares of a tray without tracks.
_UNTRACKED = (math.nan, math.nan, math.nan)


def experiment_chapter(context: Context) -> Chapter:
    """Table 1 and figure 1."""
    section = Section(title='The experiment (Table 1, Figure 1)')
    trays = load_trays()
    section.parts += [
        'Eight trays of beads on one plate, filmed by one camera. This report uses simulated '
        'films of that plate: an event-driven simulation of the beads, rendered through the lens '
        'of the flight camera with glare, chalk, noise, JPEG and a plate that oscillates on its '
        'springs. They are processed by the same stages as a recording from flight. After the '
        'shaking event the beads have a mean speed of '
        f'{1e3 * context.plan.mean_speed:.1f} mm/s in space, which is 7 mm/s in the picture, the '
        'peak of tray 1 in the paper; speeds are uniform from 0 to twice the mean, as in its '
        'simulation.',
        Table(
            head=('tray', 'inner size [mm]', 'content', 'chalk'),
            rows=[
                (str(k), _size(tray), _content(tray), 'yes' if tray.chalk else '')
                for k, tray in trays.items()
            ],
            caption='Table 1: the trays. Counts of JSC-1, whose mass the paper gives, are those '
            'that its Table 3 implies.',
        ),
    ]
    path = context.picture('plate.jpg')
    _write_frame(context.film(), path)
    section.parts.append(
        Picture(path=path, caption='Figure 1b: the plate, simulated, just after a shaking event.')
    )
    return Chapter(section=section)


def processing_chapter(context: Context) -> Chapter:
    """Figures 3 and 4, Table 2."""
    section = Section(title='Processing and tracking (Figures 3 and 4, Table 2)')
    film = context.film()
    steps = context.picture('steps.png')
    settings = plate_settings(trays=[3])
    frame_steps = steps_of_bag(film, settings, time=_STEPS_AT, progress=_first_half(context))
    steps_figure(steps, frame_steps, settings.speed)
    section.parts.append(
        Picture(
            path=steps, caption='Figure 4: one image of tray 3 after each step of the processing.'
        )
    )
    tracks = context.picture('tracks.png')
    _draw_tracks(context, tracks)
    section.parts.append(
        Picture(
            path=tracks,
            caption='Figure 3: detected beads of tray 1 and their paths at the end of a cycle '
            'with sticking.',
        )
    )
    rows, differences = [], []
    for tray in PAPER_TRACKED:
        paper = f'{PAPER_TRACKED[tray][0]:.0f} ± {PAPER_TRACKED[tray][1]:.0f}'
        shares = [cycle.summary['tracked'].get(str(tray), _UNTRACKED) for cycle in context.cycles]
        detected, matched, spurious = (
            _mean_and_deviation([share[k] for share in shares]) for k in range(len(_UNTRACKED))
        )
        rows.append((str(tray), paper, detected, matched, spurious))
        if tray in (1, 4):
            quantity = f'beads tracked, tray {tray} [%]'
            differences.append(Difference(quantity, paper, '', matched, '100'))
    section.parts += [
        Table(
            head=('tray', 'the paper [%]', 'detections here [%]', 'beads found [%]',
                  'detections on no bead [%]'),
            rows=rows,
            caption='Table 2: tracked beads as a share of those in the tray, without JSC-1; mean '
            'over the time after shaking, ± mean absolute deviation of the cycles as in the '
            'paper (none for a single cycle). The paper counts detections, so that spots of the '
            'background can make more than 100 %; here the truth separates beads that are found '
            'from detections where no bead is. A dash: beads among too many grains are not '
            'tracked. Tray 8 holds grains only.',
        ),
        'The paper could not track JSC-1 (trays 6 to 8), nor blue glass before the bare aluminium '
        'of trays 2 to 4; in trays 2 and 3 it took spots of the background for beads. It relied '
        'on automated tracks in trays 1 and 5 only. Speeds and sizes below come from tracks where '
        'nearly all beads are tracked, and from the structure function or the autocorrelation '
        'elsewhere; each number names its method.',
    ]  # fmt: skip
    return Chapter(section=section, differences=differences)


def _mean_and_deviation(shares: Sequence[float]) -> str:
    """Mean and mean absolute deviation of the known shares, [%]."""
    known = 100.0 * np.array([share for share in shares if np.isfinite(share)])
    if not known.size:
        return NOT_KNOWN
    mean = float(known.mean())
    deviation = f' ± {float(np.abs(known - mean).mean()):.1f}' if known.size > 1 else ''
    return f'{mean:.1f}{deviation}'


def _first_half(context: Context) -> Callable[[int, int], None]:
    return lambda done, total: context.progress(0.5 * done / max(total, 1))


def _size(tray: Tray) -> str:
    return ' x '.join(f'{1e3 * side:g}' for side in tray.dimensions)


def _content(tray: Tray) -> str:
    return '; '.join(
        f'{species.count} {species.material}, {1e3 * species.diameter_low:g}'
        + (
            f' to {1e3 * species.diameter_high:g}'
            if species.diameter_high > species.diameter_low
            else ''
        )
        + ' mm'
        for species in tray.species
    )


def _write_frame(film: Path, path: Path) -> None:
    """Write one frame of a film as a smaller JPEG."""
    bag = BagFrames(film, '')
    for k, frame in enumerate(bag.frames()):
        if isinstance(frame, FrameError) or k < _FRAME:
            continue
        height = round(_WIDTH * frame.image.shape[0] / frame.image.shape[1])
        small = cv2.resize(frame.image, (_WIDTH, height), interpolation=cv2.INTER_AREA)
        _, content = cv2.imencode('.jpg', small, [cv2.IMWRITE_JPEG_QUALITY, 80])
        with atomic_file(path) as part:
            part.write_bytes(content.tobytes())
        return
    raise RecordingError(bag.where, 'is too short', 'make the films again')


def _draw_tracks(context: Context, path: Path) -> None:
    settings = plate_settings(trays=[1])
    bag = track_bag(
        context.film(STICKING),
        settings,
        progress=lambda done, total: context.progress(0.5 + 0.5 * done / max(total, 1)),
    )
    picture = overlay(bag.pictures[1], bag.tracks[1], bag.pixels_per_metre, path_frames=600)
    write_overlay(path, [with_scale_bar(picture, MAGNIFICATION * bag.pixels_per_metre)])
