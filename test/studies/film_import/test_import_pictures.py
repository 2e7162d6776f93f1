"""Frames of imported films: size, bit depth, pixel aspect ratio, and stream selection."""

from __future__ import annotations

from contextlib import suppress
from fractions import Fraction

import av
import cv2
import numpy as np
import pytest
from videos import (
    HEIGHT,
    START_NS,
    STARTED,
    WIDTH,
    imported,
    picture,
    set_display_matrix,
    write_images,
    write_video,
)

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.studies.analysis.bag_frames import BagFrames
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films

TIMED = ImportSettings(start_ns=START_NS, rate=Fraction(25))


# --- folders of images ----------------------------------------------------------------------


@pytest.mark.parametrize('ending', ['jpg', 'png', 'bmp'])
@pytest.mark.parametrize('size', [(WIDTH // 2, HEIGHT // 2), (HEIGHT, WIDTH), (WIDTH, 2 * HEIGHT)])
def test_images_of_another_size_are_skipped_and_counted(tmp_path, ending, size):
    folder = write_images(tmp_path / 'images', [f'{k}.{ending}' for k in range(6)])
    cv2.imwrite(str(folder / f'2.{ending}'), cv2.resize(picture(2), size))
    result, numbers, times = imported(folder, tmp_path / 'bag', TIMED)
    assert numbers == [0, 1, 3, 4, 5]
    assert times == [0, 40, 120, 160, 200]
    assert result.damaged == 1
    assert any(
        '1 frames that are damaged or of another size' in notice for notice in result.notices
    )


def ramp(number, bits):
    """A 16-bit image with all levels of so many bits, and its number."""
    gray = picture(number)[..., 1].astype(np.uint16) << (bits - 8)
    gray[HEIGHT // 2 :] = np.linspace(0, (1 << bits) - 1, WIDTH).astype(np.uint16)
    return gray


@pytest.mark.parametrize('ending', ['png', 'tif'])
@pytest.mark.parametrize('bits', [8, 10, 12, 14, 16])
def test_16_bit_images_keep_the_levels_of_the_camera(tmp_path, bits, ending):
    folder = tmp_path / 'images'
    folder.mkdir()
    for number in range(4):
        # A darker image is not brightened.
        cv2.imwrite(str(folder / f'{number}.{ending}'), ramp(number, bits) >> (number == 0))
    result, numbers, _ = imported(folder, tmp_path / 'bag', TIMED)
    assert numbers[1:] == [1, 2, 3]
    levels = [frame.image[-1].astype(int) for frame in BagFrames(tmp_path / 'bag').frames()]
    expected = np.linspace(0, 255, WIDTH)
    np.testing.assert_allclose(levels[0], expected / 2, atol=4)
    np.testing.assert_allclose(levels[1], expected, atol=4)
    text = f'its images use {bits} of their 16 bits'
    assert any(text in notice for notice in result.notices) == (bits < 16)
    as_stored = bits == 16 and ending == 'png'
    assert (result.provenance['pictures'] == 'as stored') == as_stored


# --- interlaced films -----------------------------------------------------------------------


@pytest.mark.parametrize('marked', [True, False])
def test_a_film_that_is_marked_as_interlaced_says_so(tmp_path, marked):
    options = {'x264-params': 'tff=1'} if marked else {}
    film = write_video(tmp_path / 'my film.mp4', range(4), codec='libx264', **options)
    result, _, _ = imported(film, tmp_path / 'bag')
    said = [notice for notice in result.notices if 'interlaced' in notice]
    assert len(said) == marked
    if marked:
        assert f"ffmpeg -i '{film}' -vf bwdif" in said[0]


# --- pixels that are not square -------------------------------------------------------------


def stretch_video(path, ratio, codec='libx264'):
    """A video of a still disc with this pixel aspect ratio."""
    image = np.full((HEIGHT, WIDTH, 3), 30, np.uint8)
    axes = (10, round(10 * ratio))
    cv2.ellipse(image, (WIDTH // 2, HEIGHT // 2), axes, 0, 0, 360, (230, 230, 230), -1)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream(codec, rate=25)
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = 'yuvj420p' if codec == 'mjpeg' else 'yuv420p'
        stream.codec_context.sample_aspect_ratio = ratio
        for _ in range(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format='bgr24')))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize('codec', ['libx264', 'mjpeg'])
@pytest.mark.parametrize(('name', 'ratio', 'size'), [
    ('a.mp4', Fraction(4, 3), (128, 64)),
    ('a.mkv', Fraction(4, 3), (128, 64)),
    ('a.mkv', Fraction(2, 3), (96, 96)),
    ('rotated.mp4', Fraction(4, 3), (64, 128)),
    ('a.mkv', Fraction(500, 501), (96, 64)),
])  # fmt: skip
def test_pixels_are_made_square(tmp_path, name, codec, ratio, size):
    film = stretch_video(tmp_path / name, ratio, codec)
    if name == 'rotated.mp4':
        set_display_matrix(film, 0, 1, -1, 0)
    result = import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
    first = next(BagFrames(tmp_path / 'bag').frames()).image
    assert first.shape[1::-1] == size
    seen = first.max(axis=2) > 128
    across, down = (np.count_nonzero(seen.any(axis=axis)) for axis in (0, 1))
    assert abs(across - down) <= 2
    assert any('its pixels are not square; stretched from 96x64 px to' in notice
               for notice in result.notices) == (size != (WIDTH, HEIGHT))  # fmt: skip
    as_stored = codec == 'mjpeg' and size == (WIDTH, HEIGHT)
    assert (result.provenance['pictures'] == 'as stored') == as_stored


def test_an_impossible_aspect_ratio_is_refused(tmp_path):
    film = stretch_video(tmp_path / 'a.mp4', Fraction(9))
    with pytest.raises(RecordingError, match=r'states an impossible pixel aspect ratio, 9:1; '):
        import_films([film], tmp_path / 'bag', STARTED, lambda _: None)


# --- several streams ------------------------------------------------------------------------


def write_streams(path, *streams):
    """A video of several streams: codec, frame numbers, whether it is a cover."""
    with av.open(str(path), 'w') as container:
        added = []
        for codec, numbers, cover in streams:
            stream = container.add_stream(codec, rate=25)
            stream.width, stream.height = WIDTH, HEIGHT
            stream.pix_fmt = 'yuvj420p' if codec == 'mjpeg' else 'yuv420p'
            if cover:
                # Old versions of PyAV have no disposition; then the cover has fewer frames.
                with suppress(AttributeError):
                    stream.disposition = av.stream.Disposition.attached_pic
            added.append((stream, numbers))
        for stream, numbers in added:
            for number in numbers:
                frame = av.VideoFrame.from_ndarray(picture(number), format='bgr24')
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
    return path


COVER, FILM, OTHER = ('mjpeg', [99], True), ('mpeg4', range(12), False), ('mpeg4', [50], False)


@pytest.mark.parametrize('streams', [
    (COVER, FILM), (FILM, COVER), (OTHER, FILM), (FILM, OTHER),
    (FILM, ('mpeg4', range(40, 53), False)),
])  # fmt: skip
@pytest.mark.parametrize('name', ['a.mkv', 'a.mp4'])
def test_the_film_is_selected_instead_of_the_cover(tmp_path, name, streams):
    film = write_streams(tmp_path / name, *streams)
    result, numbers, times = imported(film, tmp_path / 'bag')
    assert numbers == list(range(12))
    np.testing.assert_allclose(times, [40 * k for k in range(12)], atol=0.6)
    assert any('holds 2 video streams; number ' in notice for notice in result.notices)
