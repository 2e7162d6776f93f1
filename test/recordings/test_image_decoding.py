"""A JPEG is decoded to the pixels that OpenCV gives, whichever library decodes it."""

from __future__ import annotations

import io
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from PIL import Image

from nanorocks_ros.recordings import image_decoding
from nanorocks_ros.recordings.image_decoding import decoded_image

SIZE = 217, 333
AS_STORED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION
GRAY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
SUBSAMPLING = ('411', '420', '422', '440', '444')
_START_OF_FRAME, _HUFFMAN_TABLES, _SCAN = b'\xff\xc0', 0xC4, 0xDA


def picture():
    coarse = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    return cv2.resize(coarse, SIZE[::-1])


def by_pillow(mode='RGB', **options):
    packed = io.BytesIO()
    Image.fromarray(picture()[:, :, ::-1]).convert(mode).save(packed, 'JPEG', **options)
    return packed.getvalue()


def by_opencv(*options):
    return cv2.imencode('.jpg', picture(), options)[1].tobytes()


def turned():
    exif = Image.Exif()
    exif[0x112] = 6
    return by_pillow(exif=exif)


def without_huffman_tables():
    content = by_opencv()
    kept, offset = content[:2], 2
    while content[offset + 1] != _SCAN:
        end = offset + 2 + int.from_bytes(content[offset + 2 : offset + 4], 'big')
        kept += b'' if content[offset + 1] == _HUFFMAN_TABLES else content[offset:end]
        offset = end
    return kept + content[offset:]


def damaged():
    content = bytearray(by_opencv())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(40)
    return bytes(content)


def without_rows():
    content = bytearray(by_opencv())
    place = content.index(_START_OF_FRAME) + 5
    content[place : place + 2] = bytes(2)
    return bytes(content)


WHOLE = {
    'gray': by_pillow('L'),
    'progressive': by_pillow(progressive=True),
    'stored as RGB': by_pillow(keep_rgb=True),
    'turned by EXIF': turned(),
    'restart markers': by_opencv(cv2.IMWRITE_JPEG_RST_INTERVAL, 3),
    'no Huffman tables': without_huffman_tables(),
    'padded': by_opencv() + bytes(30),
} | {
    f'4:{kind[1]}:{kind[2]}': by_opencv(
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR, getattr(cv2, f'IMWRITE_JPEG_SAMPLING_FACTOR_{kind}')
    )
    for kind in SUBSAMPLING
}
ODD = {
    'CMYK': by_pillow('CMYK'),
    'truncated': by_opencv()[:5000],
    'truncated, with an end marker': by_opencv()[:5000] + b'\xff\xd9',
    'damaged': damaged(),
    'more bytes after it': by_opencv() + b'abc',
    'no rows': without_rows(),
    'only a header': by_opencv()[:200],
    'PNG': cv2.imencode('.png', picture())[1].tobytes(),
    'text': b'no image',
}


def bytes_of(content):
    return np.frombuffer(content, dtype=np.uint8)


@pytest.mark.parametrize('content', (WHOLE | ODD).values(), ids=(WHOLE | ODD).keys())
@pytest.mark.parametrize('gray', [False, True], ids=['stored', 'brightness'])
@pytest.mark.parametrize('installed', [True, False], ids=['simplejpeg', 'OpenCV'])
def test_an_image_has_the_pixels_that_opencv_gives(content, gray, installed, monkeypatch):
    if not installed:
        monkeypatch.setattr(image_decoding, 'simplejpeg', None)
    expected = cv2.imdecode(bytes_of(content), GRAY if gray else AS_STORED)
    image = decoded_image(bytes_of(content), gray=gray)
    if expected is None:
        assert image is None
        return
    assert image.shape == expected.shape
    assert image.flags.c_contiguous
    assert np.array_equal(image, expected)


@pytest.mark.parametrize('content', WHOLE.values(), ids=WHOLE.keys())
def test_a_whole_jpeg_does_without_opencv(content, monkeypatch):
    pytest.importorskip('simplejpeg')
    monkeypatch.setattr(cv2, 'imdecode', None)
    assert decoded_image(bytes_of(content)).shape[:2] == SIZE


@pytest.mark.parametrize('library', ['image_decoding.simplejpeg', 'None'])
def test_a_jpeg_that_claims_too_many_pixels_is_refused_unread(library, tmp_path):
    # OpenCV reads its limit once: in a process of its own.
    path = tmp_path / 'large.jpg'
    path.write_bytes(by_opencv())
    code = f"""
import numpy as np
from nanorocks_ros.errors import FrameError
from nanorocks_ros.recordings import image_decoding
image_decoding.simplejpeg = {library}
try:
    image_decoding.decoded_image(np.fromfile({str(path)!r}, np.uint8))
except FrameError as error:
    print(error)
"""
    environment = os.environ | {'NANOROCKS_MAX_IMAGE_PIXELS': '1000'}
    environment.pop('OPENCV_IO_MAX_IMAGE_PIXELS', None)
    done = subprocess.run(
        [sys.executable, '-c', code], env=environment, check=True, capture_output=True, text=True
    )
    assert 'NANOROCKS_MAX_IMAGE_PIXELS' in done.stdout
