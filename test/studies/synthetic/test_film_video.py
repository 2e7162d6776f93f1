"""Videos of a simulated tray read back as they were drawn."""

from __future__ import annotations

import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest

from nanorocks_ros.errors import ConfigurationError
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.settings import SimulationSettings
from nanorocks_ros.simulation.tray_camera.tray_film import film
from nanorocks_ros.simulation.tray_camera.tray_renderer import TrayCamera
from nanorocks_ros.studies.synthetic.film_video import close_up, film_into_video

TRAY = load_trays()[1]
SETTINGS = replace(
    SimulationSettings(),
    width_px=240,
    height_px=180,
    pixels_per_metre=9000.0,
    frame_rate=25.0,
    first_shake=0.0,
)


def filmed(path, settings=SETTINGS, duration=0.6):
    made = film_into_video(path, settings, TRAY, duration=duration, progress=lambda *_: None)
    video = cv2.VideoCapture(str(path))
    rate = video.get(cv2.CAP_PROP_FPS)
    frames = []
    while True:
        read, frame = video.read()
        if not read:
            return made, rate, frames
        frames.append(frame)


def assert_as_drawn(frames, largest):
    drawn = [frame.image for frame, _ in film(SETTINGS, TRAY, len(frames))]
    for number, (frame, expected) in enumerate(zip(frames, drawn, strict=True)):
        assert np.abs(frame.astype(int) - expected).mean() < largest, number


def test_motion_jpeg_reads_back(tmp_path):
    made, rate, frames = filmed(tmp_path / 'run.avi')
    assert made == {'frames': 15, 'duration': 0.6}
    assert rate == 25.0
    assert_as_drawn(frames, 4.0)
    assert [path.name for path in tmp_path.iterdir()] == ['run.avi']


def test_h264_reads_back(tmp_path):
    av = pytest.importorskip('av')
    _, rate, frames = filmed(tmp_path / 'run.mp4')
    assert rate == 25.0
    assert_as_drawn(frames, 4.0)
    with av.open(str(tmp_path / 'run.mp4')) as container:
        codec = container.streams.video[0].codec_context
        # What browsers and telephones play.
        assert (codec.name, codec.pix_fmt) == ('h264', 'yuv420p')
    content = (tmp_path / 'run.mp4').read_bytes()
    assert content.index(b'moov') < content.index(b'mdat')


def test_odd_sides_lose_a_line_in_h264(tmp_path):
    pytest.importorskip('av')
    odd = replace(SETTINGS, width_px=241, height_px=181, frame_rate=29.97)
    _, rate, frames = filmed(tmp_path / 'run.mp4', odd, duration=0.1)
    assert [frame.shape for frame in frames] == [(180, 240, 3)] * 3
    assert rate == pytest.approx(29.97)


def test_an_interruption_leaves_no_video(tmp_path):
    def interrupted(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film_into_video(tmp_path / 'run.avi', SETTINGS, TRAY, duration=1.0, progress=interrupted)
    assert list(tmp_path.iterdir()) == []


def test_without_pyav_it_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'av', None)
    with pytest.raises(ConfigurationError, match=r'\.avi file, or run: pip install av'):
        filmed(tmp_path / 'run.mp4')
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('number', range(1, 9))
def test_a_close_up_is_full_of_tray(number):
    tray = load_trays()[number]
    settings = close_up(SimulationSettings(), tray)
    region = TrayCamera(settings, tray, np.array([1e-3]), ('glass',)).region
    assert max(region.width / settings.width_px, region.height / settings.height_px) > 0.8
    assert settings.width_px % 2 == settings.height_px % 2 == 0
    assert settings.width_px <= 1280
    assert settings.height_px <= 720
