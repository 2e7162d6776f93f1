"""Films that were cut short or lack parts are told, and whole ones are not."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from PIL import Image

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


@pytest.mark.parametrize(('share', 'padding', 'is_told'), [
    (1.0, b'', False), (1.0, bytes(300), False), (0.5, b'', True), (0.9, b'', True),
])  # fmt: skip
def test_a_gif_without_its_end_was_cut(tmp_path, share, padding, is_told):
    path = tmp_path / 'x.gif'
    images = [Image.new('L', (64, 48), 40 * number) for number in range(6)]
    images[0].save(path, save_all=True, append_images=images[1:], duration=40)
    content = path.read_bytes()
    path.write_bytes(content[: round(share * len(content))] + padding)
    film, count = read(path)
    assert count == len(images) or is_told
    assert film.losses == (('ends without the mark of its end: it was cut short',) * is_told)


@pytest.mark.parametrize('frames', [15, 90])
def test_a_far_last_time_is_told(tmp_path, frames):
    path = tmp_path / 'x.mkv'
    with av.open(str(path), 'w') as container:
        stream = container.add_stream('mjpeg', rate=30)
        stream.width, stream.height, stream.pix_fmt = 64, 48, 'yuvj420p'
        stream.time_base = Fraction(1, 1000)
        for number in range(frames):
            pixels = np.full((48, 64, 3), 2 * number, dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(pixels, format='bgr24')
            frame.pts = 1000 * (1_000_000 if number == frames - 1 else number) // 30
            frame.time_base = Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    film, count = read(path)
    assert count == frames
    (loss,) = film.losses
    assert loss.startswith('jumps by 3333')
    assert 'joins recordings of different times' in loss


def test_a_rate_that_hardly_a_camera_has_is_told(tmp_path):
    path = write(tmp_path / 'x.avi', *KINDS['avi'])
    content = bytearray(path.read_bytes())
    header = content.index(b'strh') + 8
    # Scale and rate of the stream.
    content[header + 20 : header + 28] = (1).to_bytes(4, 'little') + bytes([255]) * 4
    path.write_bytes(content)
    film, count = read(path)
    assert count == FRAMES
    assert any('not the rate of the camera' in loss for loss in film.losses)
    told = Video(path, Fraction(30), threads=1)
    assert sum(1 for _ in told.frames()) == FRAMES
    assert not any('rate' in loss for loss in told.losses)
