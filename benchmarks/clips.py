"""Real clips that nobody here made: discs found, beside trackpy, with a diameter told.

``python -m benchmarks.clips FOLDER`` fetches the clips into a folder, from the commit named here,
counts the discs in each and draws those of a frame as FOLDER/NAME.png. `--mirror DIR` takes them
from clones DIR/OWNER+NAME/repo instead of the network; `--peer PYTHON` runs trackpy beside, by an
interpreter that has it. The clips are not part of this project.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from benchmarks.recognition import discs_in, read_clip, with_discs

_RAW = 'https://raw.githubusercontent.com'
_PEER = """
import json, sys, time
import numpy, trackpy
trackpy.quiet()
frames, diameter, invert = numpy.load(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == 'dark'
counts, seconds = [], 0.0
trackpy.locate(frames[0], diameter, invert=invert)
for frame in frames:
    start = time.process_time()
    found = trackpy.locate(frame, diameter, invert=invert)
    seconds += time.process_time() - start
    counts.append(int((found.mass > 0.3 * found.mass.median()).sum()))
print(json.dumps([counts, seconds / len(frames)]))
"""


class Clip(NamedTuple):
    """A clip: where it is, its hash, the diameter told, and whether the beads are dark."""

    repository: str
    commit: str
    path: str
    licence: str
    sha256: str
    diameter: int
    brightness: str


_TRACKER = 'MikeSmithLabTeam/particletracker', '22421de4f2bb6c5525b31bb49228b092d27a3565'
_MIT = 'MIT-style, (c) 2021 Mike Smith and James Downs'
CLIPS = {
    'hydrogel': Clip(
        *_TRACKER,
        'testdata/hydrogel.mp4',
        _MIT,
        '4a0e81900ad547deeebdec189946ded28935b8c78ddce165bacece53658c446b',
        27,
        'dark',
    ),
    'discs': Clip(
        *_TRACKER,
        'testdata/discs.mp4',
        _MIT,
        '7adccedf2f12e1f0df62c59d4d75e1f1455258c0d97c220cd9aeee70bdf5abc8',
        107,
        'bright',
    ),
    'colloids': Clip(
        *_TRACKER,
        'testdata/colloids.mp4',
        _MIT,
        '2284150cbed89858feac6c91a3e985379bc51ec3218e23e6c70aabb9bc0cb39b',
        5,
        'bright',
    ),
    'bacteria': Clip(
        *_TRACKER,
        'testdata/bacteria.mp4',
        _MIT,
        '6c76d4cb253c1216a212827e9a6bf4957b3d219f3a8ece2c27b9beecdb7f0509',
        9,
        'bright',
    ),
    'bounce': Clip(
        'LouiseMassager/DDE_project_bouncingball',
        '0b1df771219444250d1ae11465fd81eba11dd7ef',
        'tracking/videos/test.gif',
        'none stated',
        '8b68d56f1159ad9a17bb95282d74c2cf158be2f124b7a75777069c9f0f4571c7',
        13,
        'bright',
    ),
}
"""Clips by name."""


def fetch(clip, folder, mirror):
    """Path of a clip in the folder, fetched unless it is there; its hash is checked."""
    path = folder / Path(clip.path).name
    if not path.is_file():
        if mirror is None:
            url = f'{_RAW}/{clip.repository}/{clip.commit}/{clip.path}'
            with urllib.request.urlopen(url, timeout=60.0) as answer:
                content = answer.read()
        else:
            clone = mirror / clip.repository.replace('/', '+') / 'repo'
            call = ['git', '-C', str(clone), 'show', f'{clip.commit}:{clip.path}']
            content = subprocess.run(call, check=True, capture_output=True).stdout
        if hashlib.sha256(content).hexdigest() != clip.sha256:
            raise SystemExit(f'clips: {clip.path}: has another content than expected')
        path.write_bytes(content)
    return path


def peer_counts(clip, frames, folder, peer):
    """Features that trackpy finds in each frame, and seconds for a frame."""
    gray = np.stack([cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) for frame in frames])
    np.save(folder / 'frames.npy', gray)
    diameter = clip.diameter | 1
    call = [peer, '-c', _PEER, str(folder / 'frames.npy'), str(diameter), clip.brightness]
    answer = subprocess.run(call, check=True, capture_output=True, text=True)
    (folder / 'frames.npy').unlink()
    return json.loads(answer.stdout)


def report(folder, mirror, peer):
    """Print a row for each clip."""
    cv2.setNumThreads(1)
    print('| clip | frames | discs | ms to learn | ms per frame | trackpy | its ms per frame |')
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for name, clip in CLIPS.items():
        frames = read_clip(str(fetch(clip, folder, mirror)))
        radius = 0.5 * clip.diameter
        chosen = list(range(0, len(frames), 6))
        discs, learning, each = discs_in(frames, (radius / 1.2, 1.2 * radius))
        counts = [len(rows) for rows in discs]
        row = f'{name} | {len(frames)} | {np.median(counts):.0f} ({min(counts)} to {max(counts)})'
        row += f' | {1e3 * learning:.0f} | {1e3 * each:.1f}'
        if peer:
            theirs, cost = peer_counts(clip, [frames[k] for k in chosen], folder, peer)
            row += (
                f' | {np.median(theirs):.0f} ({min(theirs)} to {max(theirs)}) | {1e3 * cost:.1f}'
            )
        print(f'| {row} |', flush=True)
        middle = len(discs) // 2
        image = with_discs(frames[chosen[middle]], discs[middle])
        cv2.imwrite(str(folder / f'{name}.png'), image)


def main():
    """Fetch, count and compare."""
    parser = argparse.ArgumentParser(prog='python -m benchmarks.clips')
    parser.add_argument('folder', type=Path)
    parser.add_argument('--mirror', type=Path)
    parser.add_argument('--peer')
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    report(options.folder, options.mirror, options.peer)
    return 0


if __name__ == '__main__':
    sys.exit(main())
