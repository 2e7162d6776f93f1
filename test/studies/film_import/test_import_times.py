"""Time stamps of films that state their times incompletely or not at all."""

from __future__ import annotations

from fractions import Fraction

import av
import pytest
from videos import (
    HEIGHT,
    START_NS,
    STARTED,
    STEP,
    WIDTH,
    imported,
    picture,
    write_images,
    write_video,
)

from nanorocks_ros.errors import ConfigurationError, RecordingError
from nanorocks_ros.studies.film_import.film_inputs import ImportSettings
from nanorocks_ros.studies.film_import.import_film import import_films

FAST = ImportSettings(start_ns=START_NS, rate=Fraction(100))
QUIET = {'x265-params': 'log-level=none'}
SILENT = {'x265-params': 'log-level=none:vui-timing-info=0'}


def write_raw(path, numbers, rate=50, **options):
    """Write a raw stream in the format of the file extension."""
    codec = {'.h264': 'libx264', '.hevc': 'libx265', '.mjpeg': 'mjpeg'}[path.suffix]
    with av.open(str(path), 'w') as container:
        stream = container.add_stream(codec, rate=rate, options=options)
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = 'yuvj420p' if codec == 'mjpeg' else 'yuv420p'
        for number in numbers:
            frame = av.VideoFrame.from_ndarray(picture(number), format='bgr24')
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


# --- films without times --------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'options'), [('a.h264', {'bf': '2'}), ('a.hevc', QUIET)])
def test_a_raw_stream_has_its_declared_rate(tmp_path, name, options):
    film = write_raw(tmp_path / name, range(12), **options)
    result, numbers, times = imported(film, tmp_path / 'bag')
    assert numbers == list(range(12))
    assert times == [20 * k for k in range(12)]
    assert any('has no time stamps; its frame rate of 50 Hz is used' in notice
               for notice in result.notices)  # fmt: skip


@pytest.mark.parametrize(('name', 'options'), [
    ('a.mjpeg', {}), ('a.hevc', SILENT), ('a.h264', {'rate': 1000}),
])  # fmt: skip
def test_a_raw_stream_without_a_rate_needs_one(tmp_path, name, options):
    film = write_raw(tmp_path / name, range(6), **options)
    with pytest.raises(
        ConfigurationError, match=r'a\..*: has neither time stamps.*; give .* --rate 30 -o '
    ):
        import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
    assert not (tmp_path / 'bag').exists()
    _, numbers, times = imported(film, tmp_path / 'bag', FAST)
    assert numbers == list(range(6))
    assert times == [10 * k for k in range(6)]


@pytest.mark.parametrize(('rate', 'step'), [('F50:1', 20), ('F0:0', None), ('Ip', None)])
def test_uncompressed_video_has_a_rate_in_its_header_or_needs_one(tmp_path, rate, step):
    levels = [bytes([level]) * (16 * 16 * 3 // 2) for level in (10, 80, 160)]
    film = tmp_path / 'a.y4m'
    film.write_bytes(f'YUV4MPEG2 W16 H16 {rate} C420jpeg\n'.encode()
                     + b''.join(b'FRAME\n' + level for level in levels))  # fmt: skip
    if step is None:
        with pytest.raises(ConfigurationError, match='has neither time stamps nor a frame rate'):
            import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
    else:
        result = import_films([film], tmp_path / 'bag', STARTED, lambda _: None)
        assert result.duration == pytest.approx(2 * step / 1e3)


# --- parts ----------------------------------------------------------------------------------


@pytest.mark.parametrize(('ending', 'dropped'), [
    ([4] * 10, 9), ([4, 4], 1), ([4], 0),
])  # fmt: skip
def test_a_part_with_a_still_end_ends_at_its_last_frame(tmp_path, ending, dropped):
    first = [0, 1, 2, 3, *ending]
    lossless = {'codec': 'ffv1', 'pixel_format': 'bgr0'}
    films = [
        write_video(tmp_path / f'{k}.mkv', numbers, **lossless)
        for k, numbers in enumerate((first, range(5, 8)))
    ]
    result, numbers, times = imported(films, tmp_path / 'bag')
    assert numbers == list(range(8))
    assert result.duplicates_dropped == dropped
    assert times[5:] == [STEP * (len(first) + k) for k in range(3)]


def test_a_part_of_duplicates_is_followed_without_a_gap(tmp_path):
    stored = [number for number in range(10) for _ in range(2)]
    films = [
        write_video(tmp_path / f'{k}.mkv', stored, codec='ffv1', pixel_format='bgr0')
        for k in range(2)
    ]
    _, _, times = imported(films, tmp_path / 'bag')
    assert times == [2 * STEP * k for k in range(20)]


def created(path, second):
    tags = {'creation_time': f'2023-11-14T22:13:{second:02}Z'}
    return write_video(path, range(second, second + 3), tags=tags)


def test_parts_in_the_wrong_order_are_refused(tmp_path):
    films = [created(tmp_path / f'{second}.mp4', second) for second in (30, 20)]
    with pytest.raises(RecordingError) as caught:
        import_films(films, tmp_path / 'bag', ImportSettings(), lambda _: None)
    message = str(caught.value)
    assert message.startswith(
        f'{films[1]}: was recorded at 2023-11-14T22:13:20Z, before the previous part {films[0]} '
    )
    assert 'pass the parts in order of time, or pass --start' in message
    assert not (tmp_path / 'bag').exists()
    _, numbers, times = imported(films, tmp_path / 'bag')
    assert numbers == [30, 31, 32, 20, 21, 22]
    assert times == [STEP * k for k in range(6)]


@pytest.mark.parametrize('seconds', [(20, 20, 20), (21, 20, 22)])
def test_parts_within_the_resolution_of_the_clock_are_in_order(tmp_path, seconds):
    films = [created(tmp_path / f'{k}.mp4', second) for k, second in enumerate(seconds)]
    result = import_films(films, tmp_path / 'bag', ImportSettings(), lambda _: None)
    assert result.frames == 9


# --- numbered images ------------------------------------------------------------------------


@pytest.mark.parametrize(('names', 'times', 'notice'), [
    (['f_7', 'f_8', 'f_9', 'f_12', 'f_13'], [0, 10, 20, 50, 60],
     '2 images are missing according to their numbers; their time is kept'),
    (['c2_010_l', 'c2_020_l', 'c2_050_l', 'c2_060_l'], [0, 10, 40, 50],
     '2 images are missing according to their numbers'),
    (['f_10', 'f_20', 'f_30'], [0, 10, 20], ''),
    (['a_1', 'a_2', 'b_7'], [0, 10, 20], ''),
    (['a', 'b', 'c'], [0, 10, 20], ''),
    (['f_1', 'f_4', 'f_11', 'f_13'], [0, 10, 20, 30],
     'the numbers of its images do not rise evenly'),
])  # fmt: skip
def test_missing_images_according_to_their_numbers_leave_a_gap(tmp_path, names, times, notice):
    folder = write_images(tmp_path / 'images', [f'{name}.png' for name in names])
    result, numbers, stamps = imported(folder, tmp_path / 'bag', FAST)
    assert numbers == list(range(len(names)))
    assert stamps == times
    notices = [text for text in result.notices if 'numbers' in text]
    assert len(notices) == bool(notice)
    assert notice in ''.join(notices)
