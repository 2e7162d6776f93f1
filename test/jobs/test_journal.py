"""Journals of finished parts: which parts they accept, and when their folder goes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from nanorocks_ros.errors import RecordingError
from nanorocks_ros.jobs.journal import Journal, difference

PLAN = json.dumps({'runs': 20, 'settings': {'seed': 7}})
ARRAYS = {'speed': np.array([1.0, np.nan])}


@pytest.fixture
def folder(tmp_path):
    return tmp_path / 'a.npz.parts'


def test_parts_are_read_by_the_next_journal_of_the_same_job(folder):
    with Journal(folder, PLAN) as journal:
        journal.write('0-1', ARRAYS)
    with Journal(folder, PLAN) as journal:
        assert journal.intact_keys() == ['0-1']
        np.testing.assert_array_equal(journal.read('0-1')['speed'], ARRAYS['speed'])


def test_a_folder_without_parts_is_deleted(folder):
    with Journal(folder, PLAN):
        assert folder.is_dir()
    assert not folder.exists()


def test_other_files_stay_when_the_parts_are_deleted(folder):
    with Journal(folder, PLAN) as journal:
        journal.write('0-1', ARRAYS)
        (folder / 'notes.txt').touch()
        journal.delete()
    assert [file.name for file in folder.iterdir()] == ['notes.txt']


def test_a_folder_belongs_to_one_process_and_one_job(folder):
    with Journal(folder, PLAN) as journal:
        journal.write('0-1', ARRAYS)
        with pytest.raises(RecordingError, match='is in use by another process'):
            Journal(folder, PLAN)
    other = json.dumps({'runs': 21, 'settings': {'seed': 7}})
    with pytest.raises(RecordingError, match=r'belongs to another job \(runs: 20, not 21\)'):
        Journal(folder, other)
    # The refusal unlocks the folder.
    with Journal(folder, PLAN) as journal:
        assert journal.keys() == ['0-1']


def test_a_damaged_part_is_deleted_and_noted(folder):
    with Journal(folder, PLAN) as journal:
        journal.write('0-1', ARRAYS)
        path = folder / '0-1.npz'
        path.write_bytes(path.read_bytes()[:-40])
        assert journal.intact_keys() == []
        assert journal.notices == [f'{path}: is damaged; it is made again']
    assert not folder.exists()


@pytest.mark.parametrize('key', ['', '../a', '.hidden', 'a b'])
def test_a_key_is_a_plain_file_name(folder, key):
    with Journal(folder, PLAN) as journal, pytest.raises(RecordingError, match='cannot name'):
        journal.write(key, ARRAYS)


def test_a_difference_names_at_most_three_entries():
    before, after = (dict.fromkeys('abcde', value) for value in (1, 2))
    text = 'a: 1, not 2; b: 1, not 2; c: 1, not 2 and 2 more'
    assert difference(json.dumps(before), json.dumps(after)) == text
    assert difference(PLAN, '{"runs": 20}') == 'settings.seed: 7, not null'
    assert difference('[]', PLAN) == 'its specification cannot be read'
