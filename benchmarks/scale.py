"""Rulers of the image scale on films with a known scale, told right and wrong.

Films by other code come from the folder that ``NANOROCKS_FOREIGN`` names; default:
``shared/data/foreign`` beside the checkout. Without it there is nothing to measure.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records import Frame, Notice, PairCollision, Quality, TrayImage
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.stages.contacts.contact_finder import ContactFinder
from nanorocks_ros.stages.preprocess.frame_preprocessor import Preprocessor
from nanorocks_ros.stages.scale.scale_check import ScaleCheck
from nanorocks_ros.stages.tracking.tracker import Tracker

FOLDER = 'NANOROCKS_FOREIGN'
_BESIDE = Path(__file__).resolve().parents[2] / 'shared' / 'data' / 'foreign'
_FACTORS = 1.0, 0.9, 0.95, 0.97, 1.03, 1.05, 1.1
_SCALE = 13500.0


def _frames(path: Path, rate: float) -> Iterator[Frame]:
    video = cv2.VideoCapture(str(path))
    number = 0
    while True:
        decoded, image = video.read()
        if not decoded:
            break
        yield Frame(
            stamp_ns=round(number * 1e9 / rate), encoding='bgr8', image=np.asarray(image, np.uint8)
        )
        number += 1
    video.release()


def measured(path: Path, told: float) -> tuple[ScaleCheck, list[str]]:
    """The check of the scale after a film, and what was said of the scale.

    Parameters
    ----------
    path : Path
        Of the film; its truth lies beside it.
    told : float, [px/m]
    """
    truth = np.load(path.with_suffix('.npz'))
    tray = load_trays()[int(truth['tray'])]
    values = {'trays': (tray.number,), 'preprocess.pixels_per_metre': told}
    settings = with_values(PipelineSettings(), values, 'benchmark')
    crop = Preprocessor(settings, {tray.number: tray}, path.stem)
    tracker, finder = Tracker(settings, tray), ContactFinder(tray)
    check = ScaleCheck(settings, tray)
    notices: list[Notice] = []
    for frame in _frames(path, float(truth['fps'])):
        for record in crop.push(frame):
            if isinstance(record, Notice):
                notices += [record] if 'px/m' in record.text else []
            elif isinstance(record, TrayImage):
                for tracks in tracker.push(record):
                    notices += check.push(tracks)
                    for contact in finder.push(tracks):
                        if isinstance(contact, PairCollision):
                            notices += check.push(contact)
    return check, [notice.text for notice in (*notices, *check.flush())]


def report() -> None:
    """Print a table of the rulers, flags and advice for each film and each scale told."""
    folder = Path(os.environ.get(FOLDER, _BESIDE))
    print('| film | told / true | rulers / true scale | flag | advised / true |')
    print('|' + ' --- |' * 5)
    for path in sorted(folder.glob('*.mp4')):
        camera = json.loads(str(np.load(path.with_suffix('.npz'))['px']))
        true = 1e3 * float(camera.get('s', _SCALE / 1e3))
        for factor in _FACTORS:
            check, texts = measured(path, factor * true)
            rulers = ', '.join(f'{factor * ruler.ratio:.3f}' for ruler in check.rulers[1:])
            advice = [
                text.rsplit('per-metre ', 1)[1].split()[0] for text in texts if '--pre' in text
            ]
            ratio = ', '.join(f'{float(value) / true:.3f}' for value in advice) or '-'
            flag = ', '.join(Quality(check.flag).names()) or '-'
            print(f'| {path.stem} | {factor:.2f} | {rulers} | {flag} | {ratio} |', flush=True)
