"""Size, rate and frames of a recording."""

from __future__ import annotations

import pytest
from videos import HEIGHT, STARTED, STEP, TICKS, WIDTH, number_of, write_video

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.studies.film_import.import_film import import_films
from nanorocks_ros.studies.measure.film_samples import film_samples


def bag_of(tmp_path, frames):
    film = write_video(tmp_path / 'a.avi', range(frames))
    return import_films([film], tmp_path / 'bag', STARTED, lambda done: None).bag


def test_the_first_frames_tell_size_and_rate(tmp_path):
    samples = film_samples(bag_of(tmp_path, 60))
    assert samples.size == (WIDTH, HEIGHT)
    assert samples.rate == pytest.approx(TICKS / STEP)
    assert [number_of(frame) for frame in samples.frames] == list(range(8))


def test_frames_of_the_whole_film_are_spread_over_it(tmp_path):
    samples = film_samples(bag_of(tmp_path, 60), whole=True)
    assert [number_of(frame) for frame in samples.frames] == list(range(0, 60, 2))


def test_a_single_frame_is_no_film(tmp_path):
    with pytest.raises(RecordingError, match='fewer than two frames'):
        film_samples(bag_of(tmp_path, 1))
