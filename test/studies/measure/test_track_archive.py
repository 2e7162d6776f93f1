"""Tracks in a file come back as they were, and only for what they were made from."""

from __future__ import annotations

import numpy as np
from bead_paths import PIXEL, RATE, tracks_of

from nanorocks_ros.experiment.plate import Region
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.records.result_words import FlagWords
from nanorocks_ros.settings import PipelineSettings, with_values
from nanorocks_ros.studies.analysis.bag_tracks import TrackedBag
from nanorocks_ros.studies.analysis.recognition_verdicts import Verdict
from nanorocks_ros.studies.measure.track_archive import save_tracks, saved_tracks, tracking_key

SETTINGS = PipelineSettings()
FLAG = FlagWords('nothing_seen', 'text', 'remedy')


def tracked():
    time = np.arange(12) / RATE
    places = np.stack([0.003 + 0.002 * time, 0.004 + 0.001 * time], axis=1)[:, None]
    records = [
        *tracks_of(places, jitter=0.1 * PIXEL),
        *tracks_of(np.empty((2, 0, 2))),
    ]
    trays = load_trays()
    return TrackedBag(
        epoch_ns=5,
        pixels_per_metre=SETTINGS.preprocess.pixels_per_metre,
        trays={1: trays[1]},
        tracks={1: records},
        numbers={1: list(range(14))},
        frames=15,
        notices=['a bad frame'],
        regions={1: Region(1, 2, 30, 40)},
        verdicts={1: (Verdict(tray=1, material='a', text='b', usable=False, flags=(FLAG,)),)},
    )


def test_tracks_come_back_as_they_were(tmp_path):
    bag, path = tracked(), tmp_path / 'tracks.npz'
    save_tracks(path, bag, 'key')
    again = saved_tracks(path, SETTINGS, 'key')
    assert (again.frames, again.epoch_ns, again.notices) == (15, 5, ['a bad frame'])
    assert again.regions == bag.regions
    assert again.numbers == bag.numbers
    assert again.verdicts == bag.verdicts
    assert not again.usable
    assert len(again.tracks[1]) == 14
    for before, after in zip(bag.tracks[1], again.tracks[1], strict=True):
        assert before.stamp_ns == after.stamp_ns
        assert (before.positions == after.positions).all()
        assert (before.seen == after.seen).all()
        assert before.ids.tolist() == after.ids.tolist()


def test_other_keys_and_damaged_files_give_nothing(tmp_path):
    path = tmp_path / 'tracks.npz'
    assert saved_tracks(path, SETTINGS, 'key') is None
    save_tracks(path, tracked(), 'key')
    assert saved_tracks(path, SETTINGS, 'other') is None
    path.write_bytes(path.read_bytes()[:200])
    assert saved_tracks(path, SETTINGS, 'key') is None


def test_the_key_follows_from_recording_and_settings(tmp_path):
    bag = tmp_path / 'a.mcap'
    bag.write_bytes(b'1')
    key = tracking_key(bag, SETTINGS, '')
    assert key == tracking_key(bag, SETTINGS, '')
    other = with_values(SETTINGS, {'preprocess.pixels_per_metre': 9000.0}, 'test')
    assert tracking_key(bag, other, '') != key
    bag.write_bytes(b'12')
    assert tracking_key(bag, SETTINGS, '') != key
