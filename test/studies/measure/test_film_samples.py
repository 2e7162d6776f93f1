"""Size and frames of a recording."""

from __future__ import annotations

import pytest
from videos import HEIGHT, STARTED, WIDTH, number_of, write_video

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.recordings.bag.offered_topics import offered_topic
from nanorocks_ros.recordings.bag.writer import BagWriter
from nanorocks_ros.recordings.messages.message_builders import compressed_image_message
from nanorocks_ros.studies.film_import.import_film import import_films
from nanorocks_ros.studies.measure.film_samples import film_samples
from nanorocks_ros.wire import topics


def bag_of(tmp_path, frames):
    film = write_video(tmp_path / 'a.avi', range(frames))
    return import_films([film], tmp_path / 'bag', STARTED, lambda done: None).bag


def test_the_first_frame_tells_the_size(tmp_path):
    samples = film_samples(bag_of(tmp_path, 60))
    assert samples.size == (WIDTH, HEIGHT)
    assert [number_of(frame) for frame in samples.frames] == [0]


def test_frames_of_the_whole_film_are_spread_over_it(tmp_path):
    samples = film_samples(bag_of(tmp_path, 60), whole=True)
    assert [number_of(frame) for frame in samples.frames] == list(range(0, 60, 2))


def test_a_film_of_broken_frames_is_refused(tmp_path):
    name = topics.RAW_COMPRESSED.absolute()
    offered = {name: offered_topic(topics.RAW_COMPRESSED)}
    with BagWriter(tmp_path / 'bag', offered, metadata={}) as bag:
        bag.write(name, 10**18, compressed_image_message(10**18, 'camera', 'jpeg', b'no picture'))
    with pytest.raises(RecordingError, match='no frame that can be used'):
        film_samples(tmp_path / 'bag')
