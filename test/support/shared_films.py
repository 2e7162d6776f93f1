"""Films that other code made, beside the checkout; tests that need them are skipped without."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

FOREIGN = Path(__file__).resolve().parents[3] / 'shared' / 'data' / 'foreign'


def foreign_film(name):
    """Path of a film; the test is skipped where it is not there."""
    path = FOREIGN / f'{name}.mp4'
    if not path.is_file():
        pytest.skip(f'{path} is not there: the film is not part of the package')
    return path


def first_picture(name):
    """The first picture of a film, bgr."""
    path = foreign_film(name)
    video = cv2.VideoCapture(str(path))
    try:
        decoded, image = video.read()
    finally:
        video.release()
    assert decoded
    return image
