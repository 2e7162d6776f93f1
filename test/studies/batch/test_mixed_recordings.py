"""Recordings that differ, and stand in one mean, are named."""

from __future__ import annotations

from pathlib import Path

from nanorocks_ros.studies.batch.batch_analysis import BagResults
from nanorocks_ros.studies.batch.mixed_recordings import mixed_recordings


def recording(name, truth=None, **metadata):
    tray = {'truth': truth, 'cycles': []}
    summary = {'trays': {'1': tray}, 'metadata': metadata}
    return BagResults(name=name, folder=Path(name), summary=summary)


def simulated(beads):
    return {'restitution': beads, 'wall_restitution': 0.99}


def test_recordings_of_one_kind_need_no_word():
    same = [recording(name, simulated(0.89)) for name in 'ab']
    assert mixed_recordings(same) == []


def test_different_truths_in_one_mean_are_named():
    mixed = [recording('a', simulated(0.89)), recording('b', simulated(0.8)), recording('c')]
    (line,) = mixed_recordings(mixed)
    assert 'tray 1: recordings with different true restitutions' in line
    assert '0.89 (walls 0.99) in 1 recording, 0.8 (walls 0.99) in 1 recording' in line
    assert 'not known in 1 recording' in line


def test_different_settings_in_one_mean_are_named():
    key = 'experiment.pixels_per_metre'
    mixed = [recording('a', **{key: '8000.0'}), recording('b', **{key: '12000.0'})]
    (line,) = mixed_recordings(mixed)
    assert 'different preprocess.pixels_per_metre, 8000.0 in 1 recording' in line


def test_recordings_of_different_trays_do_not_meet_in_a_mean():
    assert mixed_recordings([recording('a', **{'experiment.trays': '1'}), recording('b')]) == []
