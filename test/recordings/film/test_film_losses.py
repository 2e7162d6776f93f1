"""Films that were cut short or lack parts are told, and whole ones are not."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from nanorocks_ros.recordings.film.video import Video

av = pytest.importorskip('av')

FRAMES = 90
KINDS = {
    'mp4': ('mpeg4', {}),
    'avi': ('mjpeg', {}),
    'mkv': ('libx264', {'g': '15'}),
    'mov': ('libx264', {'g': '15'}),
}


def write(path, codec, options, frames=FRAMES):
    generator = np.random.default_rng(1)
    with av.open(str(path), 'w') as container:
        stream = container.add_stream(codec, rate=30, options=options)
        stream.width, stream.height = 160, 120
        stream.pix_fmt = 'yuvj420p' if codec == 'mjpeg' else 'yuv420p'
        for number in range(frames):
            pixels = generator.integers(90, 110, (120, 160, 3), dtype=np.uint8)
            pixels[40:60, number % 100 : number % 100 + 20] = 230
            frame = av.VideoFrame.from_ndarray(pixels, format='bgr24')
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def read(path):
    film = Video(path, threads=1)
    return film, sum(1 for _ in film.frames())


@pytest.mark.parametrize('suffix', KINDS)
def test_a_whole_film_lacks_nothing(tmp_path, suffix):
    film, count = read(write(tmp_path / f'x.{suffix}', *KINDS[suffix]))
    assert (count, film.losses, film.damaged) == (FRAMES, (), 0)


def test_a_film_of_which_a_few_frames_are_left_is_told(tmp_path):
    path = write(tmp_path / 'x.mkv', 'libx264', {'g': '4', 'bf': '0'})
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 15])
    film, count = read(path)
    assert 2 <= count < 10
    assert 'states 3.00 s' in film.losses[0]


@pytest.mark.parametrize(('cut', 'told'), [(0, ()), (40 * 188, ()), (40 * 188 + 77, (
    'ends in the middle of a packet: it was cut short',
))])  # fmt: skip
def test_a_transport_stream_that_ends_within_a_packet_was_cut(tmp_path, cut, told):
    path = write(tmp_path / 'x.ts', 'libx264', {'g': '15', 'bf': '0'})
    content = path.read_bytes()
    path.write_bytes(content[: len(content) - cut])
    film, count = read(path)
    assert 10 <= count <= FRAMES
    assert film.losses == told


@pytest.mark.parametrize('share', [0.3, 0.5, 0.9])
@pytest.mark.parametrize('suffix', ['avi', 'mkv'])
def test_a_film_cut_short_is_told(tmp_path, suffix, share):
    path = write(tmp_path / f'x.{suffix}', *KINDS[suffix])
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    film, count = read(path)
    assert 0 < count < FRAMES
    assert 'it was cut short' in film.losses[0]


def test_an_mp4_with_its_index_in_front_is_told_when_it_is_cut(tmp_path):
    path = tmp_path / 'x.mp4'
    with av.open(str(path), 'w', options={'movflags': 'faststart'}) as container:
        stream = container.add_stream('mpeg4', rate=30)
        stream.width, stream.height, stream.pix_fmt = 160, 120, 'yuv420p'
        for _ in range(FRAMES):
            pixels = np.random.default_rng(1).integers(0, 255, (120, 160, 3), dtype=np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format='bgr24')))
        container.mux(stream.encode())
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    film, count = read(path)
    assert count < FRAMES
    assert f'states {FRAMES} frames' in film.losses[0]


@pytest.mark.parametrize('suffix', ['mkv', 'mov'])
def test_frames_that_the_decoder_would_conceal_are_left_out_and_counted(tmp_path, suffix):
    path = write(tmp_path / f'x.{suffix}', *KINDS[suffix])
    content = bytearray(path.read_bytes())
    with av.open(str(path)) as container:
        packets = [p for p in container.demux(video=0) if p.size and p.pos is not None]
        places = [p.pos + p.size // 2 for p in packets[20:60:10]]
    for place in places:
        content[place : place + 40] = bytes(40)
    path.write_bytes(content)
    film, count = read(path)
    assert film.damaged or film.losses
    assert count <= FRAMES - len(places)


def test_missing_blocks_of_a_film_without_a_stated_count_are_told(tmp_path):
    path = write(tmp_path / 'x.mkv', *KINDS['mkv'])
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 3] + content[2 * len(content) // 3 :])
    film, count = read(path)
    assert count < FRAMES - 20
    assert film.losses
