"""Real clips that nobody here made: where they are, their licences, and how to fetch them.

``python -m benchmarks.marked_clips FOLDER`` fetches them and compares tracks with marks made by
hand. The clips are not part of this project.
"""

from __future__ import annotations

import hashlib
import math
import subprocess
import urllib.parse
import urllib.request
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from scipy.io import loadmat

_RAW = 'https://raw.githubusercontent.com'
_MARKS = Path(__file__).parent / 'clip_marks'
_EVERYWHERE = -math.inf, -math.inf, math.inf, math.inf


class Origin(NamedTuple):
    """A repository on GitHub at a commit, and the licence of what is in it."""

    repository: str
    commit: str
    licence: str


_NOTTINGHAM = Origin(
    'MikeSmithLabTeam/particletracker', '22421de4f2bb6c5525b31bb49228b092d27a3565', 'MIT'
)
_LUND = Origin(
    'mlund/particletracking', '7cc9c1ac2b4cce0d8d253f04883f6b1144593c9c', 'CC BY-SA 4.0'
)
_KARLSRUHE = Origin('GuenterQuast/ppBilliard', '475b671b5618c54d9275f5a8281f6a85dad82488', 'GPL 3')
_SAINT_ETIENNE = Origin(
    'hugolafaye/BeadTracking', 'ba014ec579ec9ce7e0af796a8b9b50987504304c', 'BSD 3-clause'
)
_URBANA = Origin(
    'alexandroid000/self-assembly', '67d451296ad4a0c12feef7b2dc2673fae37119b6', 'none stated'
)
_BRUSSELS = Origin(
    'LouiseMassager/DDE_project_bouncingball',
    '0b1df771219444250d1ae11465fd81eba11dd7ef',
    'none stated',
)
_ZAFIRUDDIN = Origin(
    'arzafiruddin/BouncingBall', 'a7c94f599eef561848296a690cd3191e44d774cd', 'none stated'
)


class Clip(NamedTuple):
    """A clip, what is told of it, and where marks are complete.

    Parameters
    ----------
    origin : Origin
    paths : tuple of str
        A video, or images in order.
    sha256 : str
        Of the files, one after the other.
    diameter : float, [px]
        Told to both programs.
    rate : float, [1/s]
    shows : str
    window : tuple of 4 floats, [px]
        Left, top, right and bottom of the part of the frame in which all beads are marked.
    truth : str
        A file of marks by others, fetched like the clip.
    """

    origin: Origin
    paths: tuple[str, ...]
    sha256: str
    diameter: float
    rate: float
    shows: str
    window: tuple[float, float, float, float] = _EVERYWHERE
    truth: str = ''


class Marks(NamedTuple):
    """Marks in a frame: number of the bead, column and row, (n, 3), [px]."""

    frame: int
    beads: np.ndarray


_FLUME = 'Data/BaumerBimAmont20'
CLIPS = {
    'hydrogel': Clip(
        _NOTTINGHAM,
        ('testdata/hydrogel.mp4',),
        '4a0e81900ad547deeebdec189946ded28935b8c78ddce165bacece53658c446b',
        27,
        30,
        'shaken: hydrogel spheres',
        (495, 315, 665, 435),
    ),
    'discs': Clip(
        _NOTTINGHAM,
        ('testdata/discs.mp4',),
        '7adccedf2f12e1f0df62c59d4d75e1f1455258c0d97c220cd9aeee70bdf5abc8',
        107,
        30,
        'sheared: clear discs of two sizes, polarised light',
        (295, 235, 880, 662),
    ),
    'shaken': Clip(
        _LUND,
        ('movies/N20-light.mp4',),
        '5a41e5a15566ef6555770ead7d3be429a29fa0452e78bf82a30aa7d8834c5f7b',
        46,
        30,
        'shaken: 20 discs with a post',
    ),
    'crowd': Clip(
        _LUND,
        ('movies/N55-light.mp4',),
        '452497488cc335b8953087378cde3c634dabd4006c70f25ab64d0873b2e7b8bd',
        46,
        30,
        'shaken: 55 discs of two colours',
    ),
    'colliding': Clip(
        _KARLSRUHE,
        ('videos/Flummies.webm',),
        'a6087677295488266309377f01139efc3e840b7a5319e2e6d22de4d39218fbaa',
        31,
        30,
        'colliding: two rubber balls, hands',
    ),
    'flume': Clip(
        _SAINT_ETIENNE,
        tuple(f'{_FLUME}/BaumerBim10MegaAmont0507Image{k}.tif' for k in range(72040, 72060)),
        'd3a8d8a0bd0dd4c88c40517e7fc24764cbb6ba9af9cb2469225218aeeb0b1b12',
        29,
        130,
        'rolling: glass beads in a stream',
        (15, 45, 1265, 290),
        f'{_FLUME}/Results/trackdatatruth.mat',
    ),
    'rolling': Clip(
        _URBANA,
        ('open_cv/SampleVideos/4Ball-short1.mp4',),
        'b354ff3b013907529bdbc6983f32bdfef1ccad51b8442b332238212819a7f185',
        31,
        30,
        'rolling: four balls, two of them of two colours',
    ),
    'bounce': Clip(
        _BRUSSELS,
        ('tracking/videos/test.gif',),
        '8b68d56f1159ad9a17bb95282d74c2cf158be2f124b7a75777069c9f0f4571c7',
        12,
        10,
        'bouncing: a green ball, a green wall',
    ),
    'drop': Clip(
        _ZAFIRUDDIN,
        ('bounceAmeen.avi',),
        '61121780889abf5970577cd922f40e199c947ef7201bbdc3e61d4d3d11e07893',
        89,
        30,
        'bouncing: a green ball, smeared',
    ),
}
"""Clips by name."""


def fetched(clip, folder, mirror=None):
    """Files of a clip in a folder, fetched unless they are there; the hash is checked.

    `mirror` has clones DIR/OWNER+NAME/repo, which are used in place of the network.
    """
    files = [_file(clip.origin, path, folder, mirror) for path in clip.paths]
    digest = hashlib.sha256(b''.join(file.read_bytes() for file in files)).hexdigest()
    if digest != clip.sha256:
        raise SystemExit(f'clips: {clip.paths[0]}: another content than expected, {digest}')
    return files


def _file(origin, path, folder, mirror):
    file = folder / Path(path).name
    if not file.is_file():
        if mirror is None:
            url = f'{_RAW}/{origin.repository}/{origin.commit}/{urllib.parse.quote(path)}'
            with urllib.request.urlopen(url, timeout=60.0) as answer:
                content = answer.read()
        else:
            clone = mirror / origin.repository.replace('/', '+') / 'repo'
            call = ['git', '--git-dir', str(clone), 'show', f'{origin.commit}:{path}']
            content = subprocess.run(call, check=True, capture_output=True).stdout
        file.write_bytes(content)
    return file


def read_frames(files):
    """Frames of a clip, in colour."""
    if len(files) > 1:
        return [cv2.imread(str(file)) for file in files]
    capture = cv2.VideoCapture(str(files[0]))
    frames = []
    while (read := capture.read())[0]:
        frames.append(read[1])
    return frames


def marks_of(name, clip, folder, mirror=None):
    """Marks of a clip, a list of Marks in order of the frames."""
    if clip.truth:
        return _others_marks(_file(clip.origin, clip.truth, folder, mirror))
    table = np.loadtxt(_MARKS / f'{name}.csv', delimiter=',', skiprows=1, ndmin=2)
    return [Marks(int(k), table[table[:, 0] == k][:, 1:]) for k in np.unique(table[:, 0])]


def _others_marks(file):
    """The black beads of every fifth frame, by the authors of the clip; pixels from 1 on."""
    frames = loadmat(file)['trackData'][0]
    marks = []
    for k in range(0, len(frames), 5):
        black = frames[k][frames[k][:, 2] == 0.0]
        marks.append(Marks(k, np.column_stack([black[:, 3], black[:, :2] - 1.0]).astype(float)))
    return marks
