"""Beads of any look on any floor: found and right, in drawn scenes and in clips.

``python -m benchmarks recognition`` draws scenes, by a painter that shares no code with the
package, and prints recall and precision with the diameter told and with nothing told.
``python -m benchmarks.recognition OUT.jpg`` makes the picture of the documentation, and
``python -m benchmarks.recognition CLIP DIAMETER_PX [PICTURE]`` counts discs in a video;
`benchmarks.clips` knows some that may be used.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from benchmarks.drawn_scenes import SCENES, draw
from nanorocks_ros.outputs.photographs import write_words
from nanorocks_ros.stages.tracking.scene.bead_looks import BeadLook
from nanorocks_ros.stages.tracking.scene.scene_model import scene_model

# A disc is right within this part of the radius of a bead.
_RIGHT = 0.3
_SEEDS = (1, 2, 3)
_LEARNING_FRAMES = 25
_EVERY = 6
_RING = 0, 255, 255
_UNKNOWN = math.nan, math.nan


class Score(NamedTuple):
    """Beads, discs, discs that are right, and sum of their squared distances, [px^2]."""

    beads: int = 0
    discs: int = 0
    right: int = 0
    squares: float = 0.0

    def __add__(self, other):
        """The sum over frames."""
        return Score(*(mine + its for mine, its in zip(self, other, strict=True)))

    @property
    def words(self):
        """Recall, precision and rms distance."""
        recall, precision = self.right / self.beads, self.right / max(self.discs, 1)
        return (
            f'{recall:.3f} | {precision:.3f} | {math.sqrt(self.squares / max(self.right, 1)):.2f}'
        )


def scored(discs, truth):
    """Score of the discs in a frame, each assigned to one bead."""
    if not len(discs):
        return Score(len(truth))
    between = discs[:, None, :2] - truth[None, :, :2]
    distances = np.hypot(between[..., 0], between[..., 1]) / truth[None, :, 2]
    rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
    near = distances[rows, columns] < _RIGHT
    squares = (distances[rows, columns] * truth[columns, 2])[near] ** 2
    return Score(len(truth), len(discs), int(near.sum()), float(squares.sum()))


def discs_in(frames, radii):
    """Discs in some of the frames, (n, 3) each, and seconds to learn and for a frame."""
    start = time.process_time()
    model = scene_model(frames[:: max(1, len(frames) // _LEARNING_FRAMES)], BeadLook(radii=radii))
    learnt = time.process_time()
    discs = []
    for frame in frames[::_EVERY]:
        candidates = model.candidates(frame)
        discs.append(candidates.outlines.discs[model.alike(candidates)])
    ended = time.process_time()
    return discs, learnt - start, (ended - learnt) / len(discs)


def drawn_score(scene, *, told):
    """Score of a drawn scene, and seconds to learn and for a frame."""
    frames, truth = draw(scene)
    low, high = scene.radii
    discs, learning, each = discs_in(frames, (low / 1.2, 1.2 * high) if told else _UNKNOWN)
    scores = [scored(*rows) for rows in zip(discs, truth[::_EVERY], strict=True)]
    return sum(scores, Score()), learning, each


def report():
    """Print recall and precision of each drawn scene, three seeds each."""
    cv2.setNumThreads(1)
    print('| scene | diameter | recall | precision | rms [px] | ms to learn | ms per frame |')
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for name, scene in SCENES.items():
        for told in (True, False):
            rows = [drawn_score(replace(scene, seed=seed), told=told) for seed in _SEEDS]
            score = sum((row[0] for row in rows), Score())
            learning, each = (1e3 * np.mean([row[k] for row in rows]) for k in (1, 2))
            word = 'told' if told else 'found'
            print(f'| {name} | {word} | {score.words} | {learning:.0f} | {each:.1f} |', flush=True)


def read_clip(path):
    """Frames of a video, in colour."""
    capture = cv2.VideoCapture(path)
    frames = []
    while (read := capture.read())[0]:
        frames.append(read[1])
    return frames


def clip_report(path, diameter, drawn=''):
    """Print the discs found in a clip, and draw those of the frame in the middle."""
    cv2.setNumThreads(1)
    frames = read_clip(path)
    radius = 0.5 * float(diameter)
    radii = (radius / 1.2, radius * 1.2) if radius > 0.0 else _UNKNOWN
    discs, learning, each = discs_in(frames, radii)
    counts = [len(rows) for rows in discs]
    size = np.median(np.concatenate(discs)[:, 2]) if sum(counts) else math.nan
    print(
        f'{path}: {len(frames)} frames, {np.median(counts):.0f} discs ({min(counts)} to '
        f'{max(counts)}), radius {size:.1f} px; {1e3 * learning:.0f} ms to learn, '
        f'{1e3 * each:.1f} ms per frame'
    )
    if drawn:
        middle = len(discs) // 2
        cv2.imwrite(drawn, with_discs(frames[_EVERY * middle], discs[middle]))


def with_discs(frame, discs, scale=1):
    """A frame, enlarged, with a ring around each disc."""
    image = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    for x, y, radius in discs:
        place = round(16 * ((x + 0.5) * scale - 0.5)), round(16 * ((y + 0.5) * scale - 0.5))
        cv2.circle(image, place, round(16 * radius * scale), _RING, 1, cv2.LINE_AA, 4)
    return image


def picture(path):
    """Write one frame of each drawn scene with the discs found, the diameter not told."""
    tiles = []
    for name, scene in SCENES.items():
        frames, _ = draw(scene)
        discs, _, _ = discs_in(frames, _UNKNOWN)
        tile = with_discs(frames[0], discs[0])
        write_words(tile, name, (8, 290), 0.55, _RING)
        tiles.append(tile)
    rows = [np.hstack(tiles[k : k + 3]) for k in range(0, len(tiles), 3)]
    cv2.imwrite(path, np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 75])


if __name__ == '__main__':
    (picture if len(sys.argv) == 2 else clip_report)(*sys.argv[1:])
