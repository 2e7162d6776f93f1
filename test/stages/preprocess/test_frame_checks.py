"""Frames that cannot be used, or not all of them, are known and told in one line."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from moving_beads import encoded, jittered, pictures, places

from nanorocks_ros.records import Frame, Quality
from nanorocks_ros.stages.preprocess.frame_checks import FrameChecks

NS = 1_000_000_000
STEP = NS // 30


def picture(number, encoding='bgr8'):
    shape = (240, 320) if encoding == 'mono8' else (240, 320, 3)
    return np.random.default_rng(number).integers(60, 200, shape, dtype=np.uint8)


def frame(number, image=None, step=STEP, encoding='bgr8'):
    pixels = picture(number, encoding) if image is None else image
    return Frame(stamp_ns=number * step, encoding=encoding, image=pixels)


def judged(frames):
    checks = FrameChecks('cam')
    verdicts = [checks.push(picture) for picture in frames]
    return checks, verdicts, [notice.text for verdict in verdicts for notice in verdict.notices]


def test_good_frames_are_used_without_a_word():
    _, verdicts, texts = judged([frame(k) for k in range(10)])
    assert all(
        verdict.usable and verdict.rows == 240 and verdict.quality == 0 for verdict in verdicts
    )
    assert texts == []


@pytest.mark.parametrize(('level', 'name'), [(1, 'black'), (254, 'white')])
def test_blank_frames_are_left_out_and_told_when_they_begin_and_end(level, name):
    blank = np.full((240, 320, 3), level, np.uint8)
    frames = [frame(k, blank if 3 <= k < 8 else None) for k in range(12)]
    _, verdicts, texts = judged(frames)
    assert [verdict.usable for verdict in verdicts] == [True] * 3 + [False] * 5 + [True] * 4
    assert texts == [
        f'cam: the picture is {name} (mean level {level}.0); left out until it returns',
        'cam: the picture is back; 5 blank frames were left out',
    ]


def test_a_30_hz_film_in_a_60_hz_file_gives_every_picture_once():
    frames = [frame(k, picture(k // 2), step=NS // 60) for k in range(40)]
    checks, verdicts, texts = judged(frames)
    assert [verdict.usable for verdict in verdicts] == [True, False] * 20
    assert checks.duplicates == 20
    (text,) = texts
    assert 'the same as the one before it' in text


def test_the_same_holds_when_the_second_copy_was_compressed_anew():
    def recoded(number):
        image = picture(number // 2).copy()
        if number % 2:
            image[::3, ::5] ^= 1
        return image

    _, verdicts, _ = judged([frame(k, recoded(k), step=NS // 60) for k in range(60)])
    # From the first frames one cannot tell what is usual.
    assert [verdict.usable for verdict in verdicts[10:]] == [True, False] * 25


def test_pictures_that_change_little_from_frame_to_frame_are_all_used():
    rng = np.random.default_rng(3)
    still = picture(0)
    frames = [
        frame(k, still + (rng.random(still.shape) < 0.02).astype(np.uint8)) for k in range(40)
    ]
    _, verdicts, _ = judged(frames)
    assert all(verdict.usable for verdict in verdicts)


def test_a_frozen_picture_is_passed_on_with_a_flag_and_told_once():
    frames = [frame(k, picture(min(k, 5))) for k in range(60)]
    _, verdicts, texts = judged(frames)
    frozen = [k for k, verdict in enumerate(verdicts) if verdict.quality & Quality.FROZEN]
    assert frozen == list(range(13, 60))
    assert all(verdicts[k].usable for k in frozen)
    assert [text for text in texts if 'stood still' in text] == [
        'cam: the picture has stood still for 1.0 s; check the camera'
    ]


def half(number, kind, rows=150):
    image = picture(number).copy()
    if kind == 'before':
        image[rows:] = picture(number - 1)[rows:]
    elif kind == 'row':
        image[rows:] = image[rows - 1]
    else:
        image[rows:] = kind
    return image


@pytest.mark.parametrize(
    'kind',
    [(128, 128, 128), (0, 135, 0), 'row', 'before'],
    ids=['gray', 'green', 'repeated row', 'lower half of the frame before'],
)
def test_of_half_a_frame_the_upper_half_is_used(kind):
    frames = [frame(k, half(k, kind) if k in (8, 20) else None) for k in range(30)]
    _, verdicts, texts = judged(frames)
    assert [k for k, verdict in enumerate(verdicts) if verdict.rows < 240] == [8, 20]
    assert verdicts[8].rows == pytest.approx(150, abs=1)
    (text,) = texts
    assert 'a frame breaks off at row 1' in text


def test_a_scene_that_always_ends_in_an_even_floor_is_whole():
    def even(number):
        image = picture(number).copy()
        image[100:] = 120
        return image

    _, verdicts, texts = judged([frame(k, even(k)) for k in range(20)])
    assert all(verdict.rows == 240 for verdict in verdicts)
    assert texts == []


def beads(speeds, codec='libx264', **options):
    """Frames of beads as a codec gives them back; the lowest rows stay still."""
    times = np.arange(len(speeds)) / 30
    grays = [
        np.concatenate([gray, np.full((48, gray.shape[1]), 90, np.uint8)])
        for gray in pictures(places(times, speeds))
    ]
    decoded = encoded(grays, codec, **options)
    return [frame(k, gray, encoding='mono8') for k, gray in enumerate(decoded)]


@pytest.mark.parametrize('crf', ['18', '28'])
@pytest.mark.parametrize('speed', [0.0, 4.0, 60.0])
def test_rows_that_a_codec_skips_are_whole_and_no_frame_is_a_duplicate(crf, speed):
    frames = beads([speed] * 90, crf=crf, g='40')
    _, verdicts, texts = judged(frames)
    assert [k for k, verdict in enumerate(verdicts) if verdict.rows < 208] == []
    assert not [text for text in texts if 'breaks off' in text]
    if speed:
        assert all(verdict.usable for verdict in verdicts)


@pytest.mark.parametrize('codec', ['libx264', 'mjpeg'])
def test_rows_of_the_frame_before_are_found_where_they_hide_beads(codec):
    frames = beads([60.0] * 40, codec)
    for k in (12, 25):
        upper, lower = frames[k].image[:64], frames[k - 1].image[64:]
        frames[k] = frame(k, np.concatenate([upper, lower]), encoding='mono8')
    _, verdicts, _ = judged(frames)
    assert [k for k, verdict in enumerate(verdicts) if verdict.rows < 208] == [12, 25]
    assert verdicts[12].rows <= 64


def test_a_camera_that_jitters_stores_no_frame_twice():
    rng = np.random.default_rng(4)
    times = np.arange(120) / 30
    still = list(pictures(places(times, [20.0] * 120), noise=0.7))
    frames = []
    for k, gray in enumerate(still):
        across, down = (0.0, 0.0) if k in (60, 61, 90, 91) else rng.normal(0, 3, 2)
        shift = np.float32([[1, 0, across], [0, 1, down]])
        moved = cv2.warpAffine(gray, shift, gray.shape[::-1], borderMode=cv2.BORDER_REFLECT)
        frames.append(frame(k, moved, encoding='mono8'))
    _, verdicts, _ = judged(frames)
    assert all(verdict.usable for verdict in verdicts)


def test_what_a_codec_skips_when_such_a_camera_comes_back_is_no_duplicate():
    times = np.arange(300) / 120
    grays = jittered(pictures(places(times, [10.0] * 300)), 2.0, (100, 150, 220, 261))
    film = [
        frame(k, gray, encoding='mono8')
        for k, gray in enumerate(encoded(grays, 'libx264', rate=120, crf='28'))
    ]
    _, verdicts, _ = judged(film)
    # Without a look at the motion it is five. The encoder does not give one stream each time.
    assert sum(not verdict.usable for verdict in verdicts) <= 2


def test_gray_pictures_are_flagged_whether_they_are_called_gray_or_not():
    copies = [np.repeat(picture(k, 'mono8')[..., None], 3, axis=2) for k in range(3)]
    _, called_color, _ = judged([frame(k, copy) for k, copy in enumerate(copies)])
    _, called_gray, _ = judged([frame(k, encoding='mono8') for k in range(3)])
    assert all(verdict.quality == Quality.GRAY_CAMERA for verdict in (*called_color, *called_gray))
