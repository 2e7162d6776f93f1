"""Tracks in real clips against marks made by hand, beside trackpy.

``python -m benchmarks.marked_clips FOLDER`` fetches the clips of `benchmarks.clips` into FOLDER
and prints the tables of the documentation; `--mirror DIR` takes them from clones, `--only NAME`
one of them. Both programs are told the diameter, and are given the same decoded frames: those
around marks, without blank and repeated ones. trackpy has its best settings: those channel, sign
and least mass, of all tried, that fit the marks best, and the search range that links most.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pandas as pd
import trackpy
from scipy.optimize import linear_sum_assignment

from benchmarks.clips import CLIPS, fetched, marks_of, read_frames
from benchmarks.recognition import with_discs
from nanorocks_ros.experiment.film_section import film_section
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import TrayImage
from nanorocks_ros.settings import PipelineSettings, PreprocessSettings
from nanorocks_ros.stages.tracking.tracker import Tracker
from nanorocks_ros.studies.measure.film_tray import FilmedBeads, FilmedTray, described_tray

# A disc is right within this part of the radius of a bead.
_RIGHT = 0.5
_LEARNING_FRAMES = 25
# Mean level below which a frame is blank.
_BLANK = 1.0
# Frames before and after a mark that are tracked.
_AROUND = 15
# Marked frames by which channel and sign are chosen.
_CHOICE = 4
# Marks of a bead in two frames give a speed when these are so many frames apart.
_MOST_APART = 6
# Quantiles of the mass that are tried as the least, and search ranges over the diameter.
_MASSES = 0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99
_RANGES = 0.3, 0.6, 1.0, 2.0
_MEMORY = 3
_CHANNELS = 'gray', 'blue', 'green', 'red'
_NS = 1_000_000_000


class Found(NamedTuple):
    """Beads that a program has: frame, number of the track, column and row, (n, 4); its cost."""

    rows: np.ndarray
    seconds: float
    learning: float = 0.0
    settings: str = ''

    def at(self, frame):
        """Number of the track, column and row of those in a frame, (n, 3)."""
        return self.rows[self.rows[:, 0] == frame][:, 1:]


class Score(NamedTuple):
    """Marks, discs where all is marked, those that are right, links and sums of steps."""

    marks: int
    discs: int
    right: int
    links: int
    linked: int
    steps: float
    marked_steps: float

    @property
    def harmonic(self):
        """Harmonic mean of recall and precision."""
        return 2.0 * self.right / max(self.marks + self.discs, 1)


def usable_frames(frames, marks):
    """Numbers of frames around marks, and of those of the film, neither blank nor repeated."""
    numbers, last = [], None
    for k, frame in enumerate(frames):
        if frame.mean() >= _BLANK and (last is None or not np.array_equal(frame, last)):
            numbers.append(k)
            last = frame
    marked = np.array([mark.frame for mark in marks])
    return [k for k in numbers if np.abs(marked - k).min() <= _AROUND], numbers


def own_tracks(clip, frames, numbers, usable):
    """Tracks by this package, told the diameter alone."""
    height, width = frames[0].shape[:2]
    beads = FilmedTray(beads=(FilmedBeads(diameter_px=clip.diameter),))
    described = described_tray(beads, (width, height))
    tray = load_trays(described.text)[1]
    scale = film_section(described.text).pixels_per_metre
    settings = replace(
        PipelineSettings(), preprocess=replace(PreprocessSettings(), pixels_per_metre=scale)
    )
    images = [
        TrayImage(
            stamp_ns=round(k * _NS / clip.rate),
            tray=1,
            gray=cv2.cvtColor(frames[k], cv2.COLOR_BGR2GRAY),
            color=frames[k],
            displacement=(0.0, 0.0),
            displacement_error=0.0,
        )
        for k in numbers
    ]
    lesson = [frames[k] for k in usable[:: max(1, len(usable) // _LEARNING_FRAMES)]]
    # The first time compiles.
    _tracked(settings, tray, lesson, images[:3])
    records, learning, seconds = _tracked(settings, tray, lesson, images)
    rows = []
    for k, record in zip(numbers, records, strict=True):
        # The centre of the first pixel is at (0.5, 0.5).
        places = record.positions[record.seen] * scale - 0.5
        rows.append(np.column_stack([np.full(len(places), k), record.ids[record.seen], places]))
    return Found(np.concatenate(rows), seconds, learning)


def _tracked(settings, tray, lesson, images):
    """Tracks, and processor time to learn what beads look like and to track."""
    start = time.process_time()
    tracker = Tracker(settings, tray)
    tracker.learn(lesson)
    learnt = time.process_time()
    records = [record for image in images for record in tracker.push(image)]
    return records, learnt - start, time.process_time() - learnt


def _channels(frame):
    """Gray and the three colours of a frame."""
    return cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY), *cv2.split(frame)


def _located(picture, clip, invert):
    """Features of trackpy: mass, column and row, (n, 3)."""
    found = trackpy.locate(picture, round(clip.diameter) | 1, invert=invert, minmass=0.0)
    return found[['mass', 'x', 'y']].to_numpy()


def peer_tracks(clip, frames, numbers, marks):
    """Tracks by trackpy, with the settings that fit the marks best."""
    trackpy.quiet()
    few = marks[:: max(1, len(marks) // _CHOICE)]
    tried = [
        (*_best_mass(clip, frames, few, channel, invert)[:1], channel, invert)
        for channel, invert in itertools.product(range(4), (False, True))
    ]
    _, channel, invert = max(tried)
    least = _best_mass(clip, frames, marks, channel, invert)[1]
    return _peer_linked(clip, frames, numbers, marks, (channel, invert, least))


def _best_mass(clip, frames, marks, channel, invert):
    """The best score of all least masses, and this mass."""
    seen = {
        mark.frame: _located(_channels(frames[mark.frame])[channel], clip, invert)
        for mark in marks
    }
    masses = np.concatenate([rows[:, 0] for rows in seen.values()])
    tried = [(-1.0, 0.0)]
    for least in np.quantile(masses, _MASSES) if len(masses) else []:
        rows = [
            np.column_stack([np.full(len(kept), frame), np.zeros(len(kept)), kept[:, 1:]])
            for frame, features in seen.items()
            for kept in [features[features[:, 0] >= least]]
        ]
        tried.append((scored(Found(np.concatenate(rows), 0.0), clip, marks).harmonic, least))
    return max(tried)


def _peer_linked(clip, frames, numbers, marks, chosen):
    channel, invert, least = chosen
    pictures = [_channels(frames[k])[channel] for k in numbers]
    diameter = round(clip.diameter) | 1
    trackpy.locate(pictures[0], diameter, invert=invert, minmass=least)
    start = time.process_time()
    located = [
        trackpy.locate(picture, diameter, invert=invert, minmass=least).assign(frame=k)
        for k, picture in zip(numbers, pictures, strict=True)
    ]
    locating = time.process_time() - start
    features = pd.concat(located, ignore_index=True)
    best = None
    for reach in _RANGES:
        start = time.process_time()
        try:
            linked = trackpy.link(features, reach * clip.diameter, memory=_MEMORY)
        except trackpy.SubnetOversizeException:
            continue
        seconds = locating + time.process_time() - start
        words = f'{_CHANNELS[channel]}, {"dark" if invert else "bright"}, minmass {least:.0f}, '
        words += f'search range {reach:g} diameters'
        rows = linked[['frame', 'particle', 'x', 'y']].to_numpy()
        found = Found(rows, seconds, settings=words)
        score = scored(found, clip, marks)
        if best is None or score.linked > best[0]:
            best = score.linked, found
    return best[1]


def scored(found, clip, marks):
    """Compare what a program found with the marks."""
    radius = 0.5 * clip.diameter
    left, top, right, bottom = clip.window
    numbers = [0] * 3
    tracks = {}
    for mark in marks:
        rows = found.at(mark.frame)
        between = np.hypot(*(mark.beads[:, None, k] - rows[None, :, k] for k in (1, 2)))
        pairs = linear_sum_assignment(np.minimum(between, 2.0 * radius))
        near = between[pairs] < _RIGHT * radius
        marked, matched = pairs[0][near], pairs[1][near]
        inside = (rows[:, 1] > left) & (rows[:, 1] < right)
        inside &= (rows[:, 2] > top) & (rows[:, 2] < bottom)
        inside[matched] = True
        # Marks of others reach beyond the window.
        count = (mark.beads[:, 1] > left) & (mark.beads[:, 1] < right)
        count &= (mark.beads[:, 2] > top) & (mark.beads[:, 2] < bottom)
        count[marked] = True
        numbers[0] += int(count.sum())
        numbers[1] += int(inside.sum())
        numbers[2] += len(marked)
        for i, j in zip(marked, matched, strict=True):
            tracks[mark.frame, int(mark.beads[i, 0])] = rows[j], mark.beads[i, 1:]
    return Score(*numbers, *_links(tracks, marks))


def _links(tracks, marks):
    """Pairs of marks of a bead, those on one track, and the way between them by both."""
    pairs, linked, steps, marked = 0, 0, 0.0, 0.0
    for first, second in itertools.pairwise(marks):
        if second.frame - first.frame > _MOST_APART:
            continue
        for bead in set(first.beads[:, 0]) & set(second.beads[:, 0]):
            pairs += 1
            ends = [tracks.get((mark.frame, int(bead))) for mark in (first, second)]
            if None in ends or ends[0][0][0] != ends[1][0][0]:
                continue
            linked += 1
            steps += float(np.hypot(*(ends[1][0][1:] - ends[0][0][1:])))
            marked += float(np.hypot(*(ends[1][1] - ends[0][1])))
    return pairs, linked, steps, marked


def _cells(found, score, frames):
    """Cells of the table for one program."""
    speed = score.steps / score.marked_steps if score.marked_steps > 0.0 else math.nan
    tracks = len(np.unique(found.rows[:, 1]))
    links = f'{score.linked} of {score.links}' if score.links else ''
    ratio = '' if math.isnan(speed) else f'{speed:.3f}'
    return (
        f'{score.right / score.marks:.3f} | {score.right / max(score.discs, 1):.3f} | {tracks} | '
        f'{links} | {ratio} | {1e3 * found.learning:.0f} | {1e3 * found.seconds / frames:.1f}'
    )


def report(folder, mirror=None, only=(), *, alone=False):
    """Print a row for each clip and program."""
    cv2.setNumThreads(1)
    folder.mkdir(parents=True, exist_ok=True)
    print(
        '| clip | marks | by | found | precision | tracks | links | speed | ms to learn | '
        'ms per frame |'
    )
    print('| --- ' * 10 + '|')
    notes = []
    for name, clip in CLIPS.items():
        if only and name not in only:
            continue
        frames = read_frames(fetched(clip, folder, mirror))
        marks = marks_of(name, clip, folder, mirror)
        numbers, usable = usable_frames(frames, marks)
        own = own_tracks(clip, frames, numbers, usable)
        programs = {'nanorocks': own}
        if not alone:
            programs['trackpy'] = peer_tracks(clip, frames, numbers, marks)
            notes.append(f'- *{name}*: {programs["trackpy"].settings}')
        for program, found in programs.items():
            score = scored(found, clip, marks)
            print(
                f'| {name} | {score.marks} | {program} | {_cells(found, score, len(numbers))} |',
                flush=True,
            )
        middle = marks[len(marks) // 2]
        places = np.pad(
            own.at(middle.frame)[:, 1:], ((0, 0), (0, 1)), constant_values=0.5 * clip.diameter
        )
        cv2.imwrite(str(folder / f'{name}.png'), with_discs(frames[middle.frame], places))
    if notes:
        print('\nSettings of trackpy:\n')
        print('\n'.join(notes))


def main():
    """Fetch, track and compare."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.marked_clips')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--mirror', type=Path)
    parser.add_argument('--only', nargs='+', default=(), choices=list(CLIPS))
    parser.add_argument('--alone', action='store_true', help='without trackpy')
    options = parser.parse_args()
    report(options.folder, options.mirror, options.only, alone=options.alone)
    return 0


if __name__ == '__main__':
    sys.exit(main())
